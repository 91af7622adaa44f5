// torquer-clip: an artificial session as a video, decoded by ffmpeg.
#include <catch2/catch.hpp>
#include <cstdint>
#include <cstdlib>
#include <fstream>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "host/recorder/gray_jpeg.h"
#include "host/recorder/screen_subtitles.h"
#include "host/simulator/jpeg_encoder.h"
#include "protocol/lcm_channels.h"
#include "tests/recorder/clip_fixture.h"
#include "tests/support/file_contents.h"
#include "tests/support/temporary_folder.h"

using namespace torquer;
using namespace torquer::test;
using Catch::Contains;

TEST_CASE("A clip shows each picture for its time, with the text of the screen") {
  const bool mp4 = GENERATE(true, false);
  const TemporaryFolder folder;
  WriteScreenLog(folder.Path("log"));
  const std::string path = folder.Path(mp4 ? "clip.mp4" : "clip.webm");
  const ProgramRun made = Clip({folder.Path("log"), path});
  CAPTURE(made.error);
  REQUIRE(made.status == 0);
  CHECK(made.error.empty());
  CHECK(made.output == "3 pictures in 75 frames, 2.50 s, 256 x 256 in " + path + "\n");
  CheckLeft(folder, {mp4 ? "clip.mp4" : "clip.webm", "log"});

  const ProgramRun probed = RunWords(
      {"/usr/bin/ffprobe", "-v", "error", "-count_frames", "-show_entries",
       "stream=codec_name,pix_fmt,width,height,r_frame_rate,nb_read_frames:format=duration", "-of",
       "default=noprint_wrappers=1", path});
  CHECK_THAT(probed.output, Contains(mp4 ? "codec_name=h264\n" : "codec_name=vp9\n"));
  CHECK_THAT(probed.output,
             Contains("width=256\nheight=256\npix_fmt=yuv420p\nr_frame_rate=30/1\n"));
  CHECK_THAT(probed.output, Contains("nb_read_frames=75\n"));
  CHECK_THAT(probed.output, Contains("duration=2.500000\n"));

  const Video video(folder, path);
  REQUIRE(video.frames() == 75);
  for (int frame = 0; frame < 75; ++frame) {
    const int level = frame < 15 ? 60 : frame < 60 ? 200 : 120;
    CheckFrame(video, frame, level, frame < 30, frame >= 15);
  }
}

TEST_CASE("A clip of a biplane session has both planes, each with its own pictures and angles") {
  const TemporaryFolder folder;
  {
    ScreenLog log(folder.Path("log"));
    log.Scene(0, "two_planes");
    log.Picture(0.1, 1, 60);
    log.Picture(0.1, 1, 200, kSide, false, 0, protocol::kLateralPictureChannel);
    log.Picture(0.5, 2, 120);
    log.Picture(0.7, 2, 90, kSide, false, 0, protocol::kLateralPictureChannel);
    log.Picture(1.1, 3, 120);
    log.Finish();
  }
  const std::string path = folder.Path("clip.mp4");
  const ProgramRun made = Clip({folder.Path("log"), path});
  CAPTURE(made.error);
  REQUIRE(made.status == 0);
  CHECK(made.output == "4 pictures in 30 frames, 1.00 s, 512 x 256 in " + path + "\n");
  const Video video(folder, path, 2 * kSide);
  REQUIRE(video.frames() == 30);
  for (int frame = 0; frame < 30; ++frame) {
    CAPTURE(frame);
    const int left = frame < 12 ? 60 : 120;
    const int right = frame < 18 ? 200 : 90;
    // The codec blurs pixels next to an edge.
    CHECK(video.Drawn(frame, 0, kTop, kSide - 8, kBottom, left, 8) == 0);
    CHECK(video.Drawn(frame, kSide + 8, kTop, 2 * kSide, kBottom, right, 8) == 0);
    // The angles are at the top right of each plane.
    CHECK(video.Drawn(frame, kMiddle + 10, 0, kSide - 8, kTop, left) > 50);
    CHECK(video.Drawn(frame, kSide + kMiddle + 10, 0, 2 * kSide, kTop, right) > 50);
    CHECK(video.Drawn(frame, kSide + 8, 0, kSide + kMiddle - 10, kTop, right) == 0);
  }
}

TEST_CASE("A clip of a span has the requested begin and end") {
  const TemporaryFolder folder;
  WriteScreenLog(folder.Path("log"));
  const std::string path = folder.Path("clip.mp4");
  std::ofstream(path) << "an older one is replaced";
  REQUIRE(Clip({folder.Path("log"), path, "--from", "0.9", "--to", "1.1"}).status == 0);
  const Video span(folder, path);
  REQUIRE(span.frames() == 6);
  for (int frame = 0; frame < 6; ++frame) {
    CheckFrame(span, frame, frame < 3 ? 60 : 200, true, frame >= 3);
  }

  // Before the first picture the screen is black, with only the time as text.
  REQUIRE(Clip({folder.Path("log"), path, "--from", "0.2", "--to", "60"}).status == 0);
  const Video early(folder, path);
  REQUIRE(early.frames() == 84);
  CHECK(early.Drawn(8, 0, 0, kSide, kBottom, 0) == 0);
  CHECK(early.Drawn(8, 0, kBottom, kMiddle, kSide, 0) > 50);
  CheckFrame(early, 9, 60, true, false);
  CheckFrame(early, 83, 120, false, true);
}

TEST_CASE("A clip of two joined logs is refused, and no video is left") {
  const TemporaryFolder folder;
  WriteScreenLog(folder.Path("log"));
  const std::string log = Contents(folder.Path("log"));
  std::ofstream(folder.Path("both"), std::ios::binary) << log << log;
  const ProgramRun made = Clip({folder.Path("both"), folder.Path("clip.mp4")});
  CHECK(made.status == 2);
  CHECK_THAT(made.error, Catch::Contains("both: 2 logs are joined in it") &&
                             Catch::Contains("give each log by itself"));
  CheckLeft(folder, {"both", "log"});
}

TEST_CASE("Text of a log stays text in a clip") {
  const TemporaryFolder folder;
  ClipFaults made;
  made.scene = "{\\an5\\fs90}A\\N\\N{\\p1}";
  WriteScreenLog(folder.Path("log"), made);
  REQUIRE(Clip({folder.Path("log"), folder.Path("clip.mp4"), "--to", "0.7"}).status == 0);
  const Video video(folder, folder.Path("clip.mp4"));
  CHECK(video.Drawn(3, 0, kTop, kSide, kBottom, 60, 8) == 0);
  CHECK(EscapeSubtitle("{a}\\N") == "\\{a\\}\\\u2060N");
  CHECK(EscapeSubtitle("neuro_angio, 2") == "neuro_angio, 2");
}

TEST_CASE("Subtitles have three digits, a unit and times as minutes and seconds") {
  const TemporaryFolder folder;
  WriteScreenLog(folder.Path("log"));
  const ScreenCourse course(folder.Path("log"));
  const std::string text = ScreenSubtitles(course, {.from_us = 2'000'000, .frames = 5}, 256, 256);
  CHECK_THAT(text, Contains("X-ray 0:12.5 min\\NAir kerma 25.0 mGy\\NContrast 12.5 mL\n") &&
                       Contains("made_up\\N0:02.0\n"));
}

TEST_CASE("A picture that came at half its size fills the clip") {
  const TemporaryFolder folder;
  ClipFaults made;
  made.half_size = true;
  WriteScreenLog(folder.Path("log"), made);
  REQUIRE(Clip({folder.Path("log"), folder.Path("clip.mp4")}).status == 0);
  const Video video(folder, folder.Path("clip.mp4"));
  CheckFrame(video, 20, 200, true, true);
}

TEST_CASE("A clip is black outside its pictures") {
  const GrayPicture wide = FitInto({2, 1, {100, 200}}, 4, 4);
  CHECK(wide.pixels == std::vector<std::uint8_t>{0, 0, 0, 0, 100, 100, 200, 200,  //
                                                 100, 100, 200, 200, 0, 0, 0, 0});
}

TEST_CASE("Without commands in a log X-ray is on while its pictures are new") {
  const TemporaryFolder folder;
  ScreenLog log(folder.Path("log"));
  log.Picture(0, 1, 60);
  log.Picture(0.1, 2, 60);
  log.Picture(0.5, 2, 60, kSide, true);
  log.Picture(0.8, 3, 60);
  log.Picture(1, 4, 60);
  log.Finish();
  const ScreenCourse course(folder.Path("log"));
  CHECK(course.At(499'999).xray);
  CHECK_FALSE(course.At(500'000).xray);
  CHECK(course.At(800'000).xray);
  CHECK(course.At(600'000).planes[0].picture == 1);
}

TEST_CASE("The pedal goes up at the end of the commands in a log, as in the simulator") {
  const TemporaryFolder folder;
  ScreenLog log(folder.Path("log"));
  log.Picture(0, 1, 60);
  log.Command(0, protocol::kGuidewire, true);
  log.Command(1, protocol::kGuidewire, true);
  log.Picture(2, 2, 60);
  log.Finish();
  const ScreenCourse course(folder.Path("log"));
  CHECK(course.At(300'000 - 1).xray);
  CHECK_FALSE(course.At(300'000).xray);
  CHECK(course.At(1'000'000).xray);
  CHECK_FALSE(course.At(1'300'000).xray);
}

TEST_CASE("Invalid bytes give no picture") {
  effects::ImageSource::Picture picture;
  picture.width = picture.height = 64;
  picture.gray.assign(64 * 64, 90);
  simulator::JpegEncoder encoder;
  const std::vector<std::uint8_t> whole = encoder.Encode(picture, 60000).bytes;
  REQUIRE(ReadGrayJpeg(whole));
  CHECK(std::abs(ReadGrayJpeg(whole)->pixels.at(100) - 90) < 3);
  for (std::size_t bytes = 0; bytes + 2 < whole.size(); ++bytes) {
    CHECK_FALSE(ReadGrayJpeg(std::span(whole).first(bytes)));
  }
  // If a picture is accepted, all of its pixels are present.
  for (std::size_t i = 0; i < whole.size(); ++i) {
    std::vector<std::uint8_t> changed = whole;
    changed[i] ^= 0xFF;
    const std::optional<GrayPicture> read = ReadGrayJpeg(changed);
    if (!read) continue;
    CHECK(read->pixels.size() ==
          static_cast<std::size_t>(read->width) * static_cast<std::size_t>(read->height));
  }
}
