// Renders and publishes X-ray pictures beside the ticks.
#pragma once

#include <atomic>
#include <condition_variable>
#include <cstdint>
#include <mutex>
#include <thread>

#include "host/bus/bus.h"
#include "host/simulator/effects/effect.h"

namespace torquer::simulator {

/// Largest JPEG of a message; LCM loses reordered fragments beyond 65,499 bytes in all.
inline constexpr std::size_t kMostPictureBytes = 60000;

/// One thread that renders the newest of what was taken; what comes while it is busy and is not the
/// newest is dropped. Repeats the last picture once a second while nothing newer is taken.
class PictureThread {
 public:
  /// All outlive this.
  PictureThread(effects::ImageSource& source, bus::Bus& bus, const char* channel);
  ~PictureThread();
  PictureThread(const PictureThread&) = delete;
  PictureThread& operator=(const PictureThread&) = delete;

  /// From the thread of the ticks: the source has taken something. Never waits for a picture.
  void Offer();

  std::int64_t rendered() const { return rendered_; }
  /// What the last picture took to render and compress; 0 before the first.
  std::int64_t last_us() const { return last_us_; }

 private:
  void RunUntilProblem();
  void Run();

  effects::ImageSource& source_;
  bus::Bus& bus_;
  const char* const channel_;
  std::mutex mutex_;
  std::condition_variable wake_;
  bool offered_ = false;
  bool stop_ = false;
  std::atomic<std::int64_t> rendered_ = 0;
  std::atomic<std::int64_t> last_us_ = 0;
  std::thread thread_;
};

}  // namespace torquer::simulator
