// Common rule of all sources: a device that may not be opened ends a program only at its start.
#pragma once

#include <cstdint>

#include "host/bus/clock.h"
#include "host/device/report_source.h"
#include "host/support/error.h"

namespace torquer::device {

class Reopening {
 public:
  /// Calls `open`, which returns true if a device is open now. Throws the UserError of `open` until
  /// a device has been open. After that the error becomes a kTrouble event, and the next attempt
  /// comes a second later.
  template <class Open>
  bool Try(const Open& open, const ReportSource::Sink& sink) {
    if (bus::MonotonicUs() < next_us_) return false;
    try {
      const bool opened = open();
      opened_once_ = opened_once_ || opened;
      return opened;
    } catch (const UserError& error) {
      if (!opened_once_) throw;
      Pause();
      sink({.kind = SourceEvent::Kind::kTrouble,
            .host_us = bus::MonotonicUs(),
            .report = {},
            .text = error.what()});
      return false;
    }
  }

  /// Prevents attempts for a second, because they would fail again.
  void Pause() { next_us_ = bus::MonotonicUs() + 1000000; }

 private:
  bool opened_once_ = false;
  std::int64_t next_us_ = 0;
};

}  // namespace torquer::device
