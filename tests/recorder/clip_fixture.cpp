#include "tests/recorder/clip_fixture.h"

#include <algorithm>
#include <catch2/catch.hpp>
#include <cstdlib>
#include <filesystem>
#include <numbers>

#include "host/simulator/jpeg_encoder.h"
#include "tests/support/child_process.h"
#include "tests/support/file_contents.h"
#include "tests/support/paths.h"
#include "torquer_lcm/instrument_command_t.hpp"
#include "torquer_lcm/picture_t.hpp"
#include "torquer_lcm/readings_t.hpp"
#include "torquer_lcm/scene_description_t.hpp"

namespace torquer::test {

ScreenLog::ScreenLog(const std::string& path) : log_(path) {}

void ScreenLog::Scene(double time_s, const std::string& name) {
  torquer_lcm::scene_description_t scene{};
  scene.name = name;
  scene.instruments = {protocol::kGuidewire};
  scene.instrument_count = 1;
  scene.radius_mm = scene.inner_radius_mm = scene.max_length_mm = {1};
  scene.inserted_at_start_mm = {1};
  Write(time_s, protocol::kSceneChannel, scene);
}

void ScreenLog::Picture(double time_s, std::int64_t number, std::uint8_t level, int side, bool held,
                        std::size_t lost_bytes, const char* channel) {
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

void ScreenLog::Command(double time_s, const std::string& instrument, bool xray) {
  torquer_lcm::instrument_command_t command{};
  command.instrument = instrument;
  command.xray = xray;
  Write(time_s, protocol::kInstrumentCommandChannel, command);
}

void ScreenLog::Readings(double time_s, const std::vector<std::string>& names) {
  torquer_lcm::readings_t readings{};
  readings.names = names;
  readings.values.assign(names.size(), 12.5);
  readings.count = static_cast<std::int32_t>(names.size());
  Write(time_s, protocol::kReadingsChannel, readings);
}

void WriteScreenLog(const std::string& path, const ClipFaults& made) {
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
      log.Readings(time_s, {"fluoroscopy_s", "air_kerma_mGy", "lateral_air_kerma_mGy",
                            "contrast_injected_mL", "other"});
    }
  }
  log.Finish();
}

ProgramRun RunWords(const std::vector<std::string>& words) {
  ChildProcess process(words);
  ProgramRun outcome;
  outcome.status = process.Wait();
  outcome.output = process.Output();
  outcome.error = process.Error();
  return outcome;
}

ProgramRun Clip(std::vector<std::string> words) {
  words.insert(words.begin(), ProgramPath("torquer-clip"));
  return RunWords(words);
}

Video::Video(const TemporaryFolder& folder, const std::string& path, int width)
    : width_(width), frame_bytes_(std::size_t{3} * kSide * static_cast<std::size_t>(width)) {
  const std::string raw = folder.Path("raw");
  const ProgramRun decoded = RunWords({"/usr/bin/ffmpeg", "-nostdin", "-v", "error", "-i", path,
                                       "-f", "rawvideo", "-pix_fmt", "rgb24", "-y", raw});
  CAPTURE(decoded.error);
  REQUIRE(decoded.status == 0);
  REQUIRE(decoded.error.empty());
  bytes_ = Contents(raw);
  REQUIRE(bytes_.size() % frame_bytes_ == 0);
}

int Video::Drawn(int frame, int left, int top, int right, int bottom, int level, int far) const {
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

int Video::Amber(int frame, int right, int bottom) const {
  int amber = 0;
  for (int y = 0; y < bottom; ++y) {
    for (int x = 0; x < right; ++x) {
      amber += At(frame, x, y, 0) > 150 && At(frame, x, y, 2) < At(frame, x, y, 0) - 60 ? 1 : 0;
    }
  }
  return amber;
}

int Video::At(int frame, int x, int y, int color) const {
  const std::size_t pixel =
      static_cast<std::size_t>(y) * static_cast<std::size_t>(width_) + static_cast<std::size_t>(x);
  const std::size_t at =
      static_cast<std::size_t>(frame) * frame_bytes_ + 3 * pixel + static_cast<std::size_t>(color);
  return static_cast<std::uint8_t>(bytes_[at]);
}

void CheckFrame(const Video& video, int frame, int level, bool xray, bool readings) {
  CAPTURE(frame, level);
  CHECK(video.Drawn(frame, 0, kTop, kSide, kBottom, level, 8) == 0);
  CHECK(video.Drawn(frame, 0, 0, kMiddle, kTop, level) > 50);
  CHECK(video.Drawn(frame, kMiddle + 10, 0, kSide, kTop, level) > 50);
  CHECK(video.Drawn(frame, 0, kBottom, kMiddle - 10, kSide, level) > 50);
  CHECK((video.Drawn(frame, kMiddle + 10, kBottom, kSide, kSide, level) > 50) == readings);
  CHECK((video.Amber(frame, kMiddle, kTop) > 10) == xray);
}

void CheckLeft(const TemporaryFolder& folder, const std::vector<std::string>& names) {
  std::vector<std::string> found;
  for (const auto& entry : std::filesystem::directory_iterator(folder.Path())) {
    found.push_back(entry.path().filename());
  }
  std::sort(found.begin(), found.end());
  CHECK(found == names);
}

}  // namespace torquer::test
