// A mechanical contact: after each change it bounces for a while.
#pragma once

#include <cstdint>
#include <random>

namespace torquer::emulator {

class Contact {
 public:
  /// Longest time between two changes within a bounce, us.
  static constexpr double kLongestDwell_us = 8000;

  /// Bounces for up to `bounce_us` after each change; 0: not at all.
  Contact(double bounce_us, std::uint32_t seed) : bounce_us_(bounce_us), random_(seed) {}

  /// True if the contact conducts now; `closed` is the position that the finger sets. Calls must
  /// come in rising order of time.
  bool Conducts(bool closed, double now_us) {
    if (closed != closed_) {
      closed_ = closed;
      quiet_from_us_ = now_us + Between(0, bounce_us_);
      next_change_us_ = now_us;
    }
    if (now_us >= quiet_from_us_) return conducts_ = closed_;
    for (; next_change_us_ <= now_us; next_change_us_ += Between(200, kLongestDwell_us)) {
      conducts_ = !conducts_;
    }
    return conducts_;
  }

 private:
  double Between(double low, double high) {
    return std::uniform_real_distribution<double>(low, high)(random_);
  }

  double bounce_us_;
  std::mt19937 random_;
  bool closed_ = false;
  bool conducts_ = false;
  double quiet_from_us_ = 0;
  double next_change_us_ = 0;
};

}  // namespace torquer::emulator
