// Renders and publishes X-ray pictures beside the ticks.
#pragma once

#include <atomic>
#include <condition_variable>
#include <cstdint>
#include <mutex>
#include <optional>
#include <thread>

#include "host/bus/bus.h"
#include "host/simulator/effects/effect.h"

namespace torquer::simulator {

/// Largest JPEG of a message. LCM loses reordered fragments of messages beyond 65,499 bytes.
inline constexpr std::size_t kMostPictureBytes = 60000;

/// Thread that renders the newest frame of `source`. Older frames that come while it is busy are
/// dropped. Repeats the last picture once a second while no new frame comes.
class PictureThread {
 public:
  /// All arguments must outlive this.
  PictureThread(effects::ImageSource& source, bus::Bus& bus, const char* channel);
  ~PictureThread();
  PictureThread(const PictureThread&) = delete;
  PictureThread& operator=(const PictureThread&) = delete;

  /// Reports that the source has taken a frame. Called by the thread of the ticks; never waits for
  /// a picture.
  void Offer();

  /// Waits for a picture that is being rendered. The next one waits until Continue.
  void Pause();
  /// Goes on after Pause, with `source`, which must outlive this.
  void Continue(effects::ImageSource& source);

  std::int64_t rendered() const { return rendered_; }
  /// Time to render and compress the last picture, us; none before the first one.
  std::optional<std::int64_t> last_us() const {
    const std::int64_t us = last_us_;
    return us < 0 ? std::nullopt : std::optional(us);
  }

 private:
  void RunUntilProblem();
  void Run();
  bool Render(effects::ImageSource::Picture& picture);

  effects::ImageSource* source_;
  bus::Bus& bus_;
  const char* const channel_;
  std::mutex mutex_;
  std::condition_variable wake_;
  std::condition_variable idle_;
  bool offered_ = false;
  bool renders_ = false;
  bool pauses_ = false;
  bool stop_ = false;
  std::atomic<std::int64_t> rendered_ = 0;
  std::atomic<std::int64_t> last_us_ = -1;  // -1: no picture yet
  std::thread thread_;
};

}  // namespace torquer::simulator
