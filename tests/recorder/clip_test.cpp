// torquer-clip: an artificial session as a video, decoded by ffmpeg.
#include <algorithm>
#include <catch2/catch.hpp>
#include <cmath>
#include <cstdint>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <numbers>
#include <string>
#include <vector>

#include "host/recorder/gray_jpeg.h"
#include "host/recorder/screen_subtitles.h"
#include "host/simulator/jpeg_encoder.h"
#include "host/support/event_log_writer.h"
#include "protocol/lcm_channels.h"
#include "tests/recorder/session_fixture.h"
#include "tests/support/child_process.h"
#include "tests/support/file_contents.h"
#include "tests/support/paths.h"
#include "tests/support/temporary_folder.h"
#include "torquer_lcm/instrument_command_t.hpp"
#include "torquer_lcm/picture_t.hpp"
#include "torquer_lcm/readings_t.hpp"
#include "torquer_lcm/scene_description_t.hpp"

using namespace torquer;
using namespace torquer::test;
using Catch::Matchers::Contains;
using Catch::Matchers::StartsWith;

namespace {

constexpr int kSide = 256;
constexpr std::int64_t kStartUs = 1'700'000'000'000'000;

class ScreenLog {
 public:
  explicit ScreenLog(const std::string& path) : log_(path) {}

  template <class Message>
  void Write(double time_s, const char* channel, const Message& message) {
    std::vector<std::uint8_t> bytes(static_cast<std::size_t>(message.getEncodedSize()));
    message.encode(bytes.data(), 0, static_cast<int>(bytes.size()));
    log_.Write(kStartUs + std::llround(1e6 * time_s), channel, bytes);
  }
  void Scene(double time_s, const std::string& name) {
    torquer_lcm::scene_description_t scene{};
    scene.name = name;
    scene.instruments = {protocol::kGuidewire};
    scene.instrument_count = 1;
    scene.radius_mm = scene.inner_radius_mm = scene.max_length_mm = {1};
    scene.inserted_at_start_mm = {1};
    Write(time_s, protocol::kSceneChannel, scene);
  }
  // Uniform picture of a given brightness.
  void Picture(double time_s, std::int64_t number, std::uint8_t level, int side = kSide,
               bool held = false, std::size_t lost_bytes = 0,
               const char* channel = protocol::kPictureChannel) {
    effects::ImageSource::Picture picture;
    picture.width = picture.height = side;
    picture.gray.assign(static_cast<std::size_t>(side) * static_cast<std::size_t>(side), level);
    simulator::JpegEncoder encoder;
    torquer_lcm::picture_t message{};
    message.data = encoder.Encode(picture, 60000).bytes;
    message.data.resize(message.data.size() - lost_bytes);
    message.byte_count = static_cast<std::int32_t>(message.data.size());
    message.number = number;
    message.width = message.height = side;
    message.encoding = "jpeg";
    message.held = held;
    message.lao_rad = 30 * std::numbers::pi / 180;
    message.cra_rad = -20 * std::numbers::pi / 180;
    Write(time_s, channel, message);
  }
  void Command(double time_s, const std::string& instrument, bool xray) {
    torquer_lcm::instrument_command_t command{};
    command.instrument = instrument;
    command.xray = xray;
    Write(time_s, protocol::kInstrumentCommandChannel, command);
  }
  void Readings(double time_s, const std::vector<std::string>& names) {
    torquer_lcm::readings_t readings{};
    readings.names = names;
    readings.values.assign(names.size(), 12.5);
    readings.count = static_cast<std::int32_t>(names.size());
    Write(time_s, protocol::kReadingsChannel, readings);
  }
  void Finish() { log_.Finish(); }

 private:
  EventLogWriter log_;
};

struct ClipFaults {
  std::string scene = "made_up";
  bool damaged_picture = false;  // second picture; the previous one stays
  bool half_size = false;        // second picture, reduced to fit
};

// The pedal is down from 0.5 to 1.5 s. Pictures come at 0.5 s with brightness 60, at 1 s with 200,
// and at 2.5 s with 120. The second is held and repeated at 2 s. Readings come from 1 s on.
void WriteScreenLog(const std::string& path, const ClipFaults& made = {}) {
  ScreenLog log(path);
  log.Scene(0, made.scene);
  for (int i = 0; i <= 60; ++i) {
    const double time_s = 0.05 * i;
    log.Command(time_s, protocol::kGuidewire, i >= 10 && i < 30);
    // Pedals of another hand do not control the X-ray.
    log.Command(time_s, "catheter", true);
    if (i == 10) log.Picture(time_s, 1, 60);
    if (i == 20) {
      log.Picture(time_s, 2, 200, made.half_size ? kSide / 2 : kSide, false,
                  made.damaged_picture ? 40 : 0);
    }
    if (i == 40 && !made.damaged_picture) log.Picture(time_s, 2, 200, kSide, true);
    if (i == 50) log.Picture(time_s, 3, 120);
    if (i >= 20) {
      log.Readings(time_s, {"fluoroscopy_s", "air_kerma_mGy", "contrast_injected_mL", "other"});
    }
  }
  log.Finish();
}

struct Outcome {
  int status = -1;
  std::string output, error;
};

Outcome RunWords(const std::vector<std::string>& words) {
  ChildProcess process(words);
  Outcome outcome;
  outcome.status = process.Wait();
  outcome.output = process.Output();
  outcome.error = process.Error();
  return outcome;
}

Outcome Clip(std::vector<std::string> words) {
  words.insert(words.begin(), ProgramPath("torquer-clip"));
  return RunWords(words);
}

// Frames of a clip as red, green, blue.
class Video {
 public:
  Video(const TemporaryFolder& folder, const std::string& path, int width = kSide)
      : width_(width), frame_bytes_(std::size_t{3} * kSide * static_cast<std::size_t>(width)) {
    const std::string raw = folder.Path("raw");
    const Outcome decoded = RunWords({"/usr/bin/ffmpeg", "-nostdin", "-v", "error", "-i", path,
                                      "-f", "rawvideo", "-pix_fmt", "rgb24", "-y", raw});
    CAPTURE(decoded.error);
    REQUIRE(decoded.status == 0);
    REQUIRE(decoded.error.empty());
    bytes_ = Contents(raw);
    REQUIRE(bytes_.size() % frame_bytes_ == 0);
  }

  int frames() const { return static_cast<int>(bytes_.size() / frame_bytes_); }

  // Number of pixels in a rectangle that differ from `level` by more than `far` in any color.
  int Drawn(int frame, int left, int top, int right, int bottom, int level, int far = 40) const {
    int drawn = 0;
    for (int y = top; y < bottom; ++y) {
      for (int x = left; x < right; ++x) {
        int most = 0;
        for (int c = 0; c < 3; ++c) most = std::max(most, std::abs(At(frame, x, y, c) - level));
        drawn += most > far ? 1 : 0;
      }
    }
    return drawn;
  }
  // Number of amber pixels in a corner.
  int Amber(int frame, int right, int bottom) const {
    int amber = 0;
    for (int y = 0; y < bottom; ++y) {
      for (int x = 0; x < right; ++x) {
        amber += At(frame, x, y, 0) > 150 && At(frame, x, y, 2) < At(frame, x, y, 0) - 60 ? 1 : 0;
      }
    }
    return amber;
  }

 private:
  int At(int frame, int x, int y, int color) const {
    const std::size_t pixel = static_cast<std::size_t>(y) * static_cast<std::size_t>(width_) +
                              static_cast<std::size_t>(x);
    const std::size_t at = static_cast<std::size_t>(frame) * frame_bytes_ + 3 * pixel +
                           static_cast<std::size_t>(color);
    return static_cast<std::uint8_t>(bytes_[at]);
  }

  int width_;
  std::size_t frame_bytes_;
  std::string bytes_;
};

// Text rows at the top and at the bottom; no text between them.
constexpr int kTop = 30;
constexpr int kBottom = kSide - 50;
constexpr int kMiddle = kSide / 2;

void CheckFrame(const Video& video, int frame, int level, bool xray, bool readings) {
  CAPTURE(frame, level);
  CHECK(video.Drawn(frame, 0, kTop, kSide, kBottom, level, 8) == 0);
  CHECK(video.Drawn(frame, 0, 0, kMiddle, kTop, level) > 50);
  CHECK(video.Drawn(frame, kMiddle + 10, 0, kSide, kTop, level) > 50);
  CHECK(video.Drawn(frame, 0, kBottom, kMiddle - 10, kSide, level) > 50);
  CHECK((video.Drawn(frame, kMiddle + 10, kBottom, kSide, kSide, level) > 50) == readings);
  CHECK((video.Amber(frame, kMiddle, kTop) > 10) == xray);
}

// Checks that the folder contains exactly these files.
void CheckLeft(const TemporaryFolder& folder, const std::vector<std::string>& names) {
  std::vector<std::string> found;
  for (const auto& entry : std::filesystem::directory_iterator(folder.Path())) {
    found.push_back(entry.path().filename());
  }
  std::sort(found.begin(), found.end());
  CHECK(found == names);
}

}  // namespace

TEST_CASE("A clip shows each picture as long as it stood, and what the screen says") {
  const bool mp4 = GENERATE(true, false);
  const TemporaryFolder folder;
  WriteScreenLog(folder.Path("log"));
  const std::string path = folder.Path(mp4 ? "clip.mp4" : "clip.webm");
  const Outcome made = Clip({folder.Path("log"), path});
  CAPTURE(made.error);
  REQUIRE(made.status == 0);
  CHECK(made.error.empty());
  CHECK(made.output == "3 pictures in 75 frames, 2.50 s, 256 x 256 in " + path + "\n");
  CheckLeft(folder, {mp4 ? "clip.mp4" : "clip.webm", "log"});

  const Outcome probed = RunWords(
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
  const Outcome made = Clip({folder.Path("log"), path});
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

TEST_CASE("A clip of a span begins and ends where it is asked to") {
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
  const Outcome made = Clip({folder.Path("both"), folder.Path("clip.mp4")});
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
  CHECK_THAT(text, Contains("X-ray 0:12.5 min\\NAir kerma 12.5 mGy\\NContrast 12.5 mL\n") &&
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

TEST_CASE("Where pictures do not fill a clip it is black") {
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

TEST_CASE("Where commands end in a log the pedal goes up as in the simulator") {
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

TEST_CASE("A damaged log becomes a clip, with status 1 and what was left out") {
  const TemporaryFolder folder;
  ClipFaults made;
  made.damaged_picture = true;
  WriteScreenLog(folder.Path("log"), made);
  const Outcome picture = Clip({folder.Path("log"), folder.Path("clip.mp4")});
  CHECK(picture.status == 1);
  CHECK_THAT(picture.error, Contains("1 messages or pictures are damaged and left out"));
  const Video video(folder, folder.Path("clip.mp4"));
  REQUIRE(video.frames() == 75);
  CheckFrame(video, 40, 60, false, true);

  WriteScreenLog(folder.Path("log2"));
  std::filesystem::resize_file(folder.Path("log2"),
                               std::filesystem::file_size(folder.Path("log2")) - 3);
  const Outcome cut = Clip({folder.Path("log2"), folder.Path("clip2.webm")});
  CHECK(cut.status == 1);
  CHECK_THAT(cut.error, StartsWith("torquer-clip: " + folder.Path("log2") + ": "));
  CHECK(Video(folder, folder.Path("clip2.webm")).frames() == 75);
}

TEST_CASE("A clip that fails is reported and leaves no file") {
  const TemporaryFolder folder;
  const std::string log = folder.Path("log");
  WriteScreenLog(log);
  WriteSession(folder.Path("no_pictures"), {});
  const std::string clip = folder.Path("clip.mp4");
  const auto refuses = [&](const std::vector<std::string>& words, const std::string& reason) {
    CAPTURE(words);
    const Outcome outcome = RunWords(words);
    CHECK(outcome.status == 2);
    CHECK(outcome.output.empty());
    CHECK_THAT(outcome.error, StartsWith("torquer-clip: "));
    CHECK_THAT(outcome.error, Contains(reason));
    CheckLeft(folder, {"log", "no_pictures"});
  };
  const std::string program = ProgramPath("torquer-clip");
  refuses({program, log}, "OUT is missing");
  refuses({program, log, folder.Path("clip.avi")}, "ends in .mp4 or .webm");
  refuses({program, log, folder.Path("none/clip.mp4")}, "cannot be written");
  refuses({program, folder.Path("none"), clip}, "cannot be read");
  refuses({program, folder.Path("no_pictures"), clip}, "holds no picture");
  refuses({program, log, clip, "--from", "2", "--to", "2"}, "--to is not later than --from");
  refuses({program, log, clip, "--from", "3.5"}, "its pictures are from 0.50 s to 3.00 s");
  refuses({program, log, clip, "--to", "0.4"}, "its pictures are from 0.50 s to 3.00 s");
  refuses({"/usr/bin/env", "PATH=/none", program, log, clip},
          "ffmpeg: cannot be started: No such file or directory; install it");
}

TEST_CASE("An encoder that ends well without a whole video leaves the old clip") {
  const std::string name = GENERATE("clip.mp4", "clip.webm");
  const std::string writes = GENERATE("", "cat > /dev/null", "cat > /dev/null; echo no video >&3",
                                      "cat > /dev/null; printf '\\0\\0\\0\\40ftypisom' >&3",
                                      "cat > /dev/null; printf '\\32\\105\\337\\243' >&3");
  CAPTURE(name, writes);
  const TemporaryFolder folder;
  WriteScreenLog(folder.Path("log"));
  std::ofstream(folder.Path("ffmpeg")) << "#!/bin/bash\n" << writes << "\nexit 0\n";
  std::filesystem::permissions(folder.Path("ffmpeg"), std::filesystem::perms::owner_all);
  std::ofstream(folder.Path(name)) << "old";
  const std::string path = folder.Path("") + ":/usr/bin:/bin";
  const Outcome outcome = RunWords({"/usr/bin/env", "PATH=" + path, ProgramPath("torquer-clip"),
                                    folder.Path("log"), folder.Path(name)});
  CHECK(outcome.status == 2);
  CHECK_THAT(outcome.error, StartsWith("torquer-clip: ffmpeg: ended with status 0, but "));
  CHECK(Contents(folder.Path(name)) == "old");
}

TEST_CASE("A full disk leaves the old clip or none, wherever it becomes full") {
  const bool mp4 = GENERATE(true, false);
  const TemporaryFolder folder;
  WriteScreenLog(folder.Path("log"));
  const std::string clip = folder.Path(mp4 ? "clip.mp4" : "clip.webm");
  // With the limit's signal ignored, the write fails with an error, as on a full disk.
  const auto make = [&](int most_blocks) {
    return RunWords({"/bin/bash", "-c", "trap '' XFSZ; ulimit -f $0; exec \"$@\"",
                     std::to_string(most_blocks), ProgramPath("torquer-clip"), folder.Path("log"),
                     clip});
  };
  int refused = 0;
  for (int most_kb = 1; most_kb < 100; ++most_kb) {
    CAPTURE(most_kb);
    const Outcome outcome = make(most_kb);
    if (outcome.status == 0) break;
    ++refused;
    CHECK(outcome.status == 2);
    CHECK_THAT(outcome.error, StartsWith("torquer-clip: ffmpeg: "));
    CheckLeft(folder, {"log"});
  }
  CAPTURE(refused);
  CHECK(refused > 3);
  CHECK(Video(folder, clip).frames() == 75);

  std::ofstream(clip) << "old";
  CHECK(make(3).status == 2);
  CHECK(Contents(clip) == "old");
}

TEST_CASE("Bytes that are no picture are none") {
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
