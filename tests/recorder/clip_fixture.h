// Artificial session for torquer-clip, and its video.
#pragma once

#include <cmath>
#include <cstddef>
#include <cstdint>
#include <string>
#include <vector>

#include "host/support/event_log_writer.h"
#include "protocol/lcm_channels.h"
#include "tests/support/temporary_folder.h"

namespace torquer::test {

inline constexpr int kSide = 256;  ///< width and height of a clip, px
inline constexpr std::int64_t kScreenStartUs = 1'700'000'000'000'000;

/// Log with what a screen shows.
class ScreenLog {
 public:
  explicit ScreenLog(const std::string& path);

  template <class Message>
  void Write(double time_s, const char* channel, const Message& message) {
    std::vector<std::uint8_t> bytes(static_cast<std::size_t>(message.getEncodedSize()));
    message.encode(bytes.data(), 0, static_cast<int>(bytes.size()));
    log_.Write(kScreenStartUs + std::llround(1e6 * time_s), channel, bytes);
  }
  void Scene(double time_s, const std::string& name);
  /// Uniform picture of a given brightness.
  void Picture(double time_s, std::int64_t number, std::uint8_t level, int side = kSide,
               bool held = false, std::size_t lost_bytes = 0,
               const char* channel = protocol::kPictureChannel);
  void Command(double time_s, const std::string& instrument, bool xray);
  void Readings(double time_s, const std::vector<std::string>& names);
  void Finish() { log_.Finish(); }

 private:
  EventLogWriter log_;
};

struct ClipFaults {
  std::string scene = "made_up";
  bool damaged_picture = false;  ///< second picture; the previous one stays
  bool half_size = false;        // second picture, reduced to fit
};

/// The pedal is down from 0.5 to 1.5 s. Pictures come at 0.5 s with brightness 60, at 1 s with 200,
/// and at 2.5 s with 120. The second is held and repeated at 2 s. Readings come from 1 s on.
void WriteScreenLog(const std::string& path, const ClipFaults& made = {});

struct ProgramRun {
  int status = -1;
  std::string output, error;
};

ProgramRun RunWords(const std::vector<std::string>& words);
/// Runs torquer-clip.
ProgramRun Clip(std::vector<std::string> words);

/// Frames of a clip as red, green, blue.
class Video {
 public:
  Video(const TemporaryFolder& folder, const std::string& path, int width = kSide);

  int frames() const { return static_cast<int>(bytes_.size() / frame_bytes_); }

  /// Number of pixels in a rectangle that differ from `level` by more than `far` in any color.
  int Drawn(int frame, int left, int top, int right, int bottom, int level, int far = 40) const;
  /// Number of amber pixels in a corner.
  int Amber(int frame, int right, int bottom) const;

 private:
  int At(int frame, int x, int y, int color) const;

  int width_;
  std::size_t frame_bytes_;
  std::string bytes_;
};

// Text rows of a frame are above the first and below the second; no text is between them.
inline constexpr int kTop = 30;
inline constexpr int kBottom = kSide - 50;
inline constexpr int kMiddle = kSide / 2;

void CheckFrame(const Video& video, int frame, int level, bool xray, bool readings);

/// Checks that the folder contains exactly these files.
void CheckLeft(const TemporaryFolder& folder, const std::vector<std::string>& names);

}  // namespace torquer::test
