// Rule by which every source opens a device: a refusal ends a program that starts, never one that
// runs.
#pragma once

#include <cstdint>

#include "host/bus/clock.h"
#include "host/device/report_source.h"
#include "host/support/error.h"

namespace torquer::device {

class Reopening {
 public:
  /// Calls `open`, which returns whether a device is open now. Its UserError passes until one has
  /// been open; from then on it is said as kTrouble, and the next attempt is a second later.
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

  /// No attempt for a second: what has just failed would fail again.
  void Pause() { next_us_ = bus::MonotonicUs() + 1000000; }

 private:
  bool opened_once_ = false;
  std::int64_t next_us_ = 0;
};

}  // namespace torquer::device
