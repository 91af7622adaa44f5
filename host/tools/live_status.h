// Live status: one status line of a running session. No I/O, no clock.
#pragma once

#include <cstddef>
#include <cstdint>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include "host/bus/active_simulators.h"
#include "host/bus/sender.h"
#include "torquer_lcm/device_sample_t.hpp"
#include "torquer_lcm/health_t.hpp"
#include "torquer_lcm/readings_t.hpp"
#include "torquer_lcm/scene_description_t.hpp"
#include "torquer_lcm/wire_state_t.hpp"

namespace torquer::tools {

/// Describes the bits of wire_state_t::status that matter to users; "ok" for none.
std::string StatusWords(std::int32_t status);

/// The first parts of a status line, as many as fit into `columns`. Parts end at " | ", so no
/// number is cut. A first part that is too long is cut and ends with "...", if that fits.
std::string FittingParts(const std::string& line, std::size_t columns);

/// Collects messages, and describes those since the last call of Line(). Outdated data is shown
/// with its age, not as the present state. All text from messages is passed through Printable.
///
/// `now_us` is the time of the call from bus::MonotonicUs(); it must not decrease.
class LiveStatus {
 public:
  /// `clock_id` is this process's clock; latencies by other clocks are ignored.
  explicit LiveStatus(std::int64_t clock_id) : clock_id_(clock_id) {}

  void Add(const torquer_lcm::device_sample_t& sample);
  void Add(const torquer_lcm::wire_state_t& state, const bus::Sender& sender, std::int64_t now_us);
  void Add(const torquer_lcm::scene_description_t& scene, const bus::Sender& sender);
  /// Returns a line about changes, or "".
  std::string Add(const torquer_lcm::health_t& health, std::int64_t now_us);
  /// Returns a line about a new wall force event or a reached target, or "".
  std::string Add(const torquer_lcm::readings_t& readings);

  /// Formats the status line without a newline. It has scene, position of each instrument, status,
  /// and wall force if the scene measures it. Devices, rates, latency, residual and penetration
  /// follow. `interval_s` is the time since the last call, > 0.
  std::string Line(double interval_s, std::int64_t now_us);

  /// Ages at which data counts as outdated. A state is published at least five times a second,
  /// health once a second.
  static constexpr std::int64_t kStateOldUs = 1'000'000;
  static constexpr std::int64_t kHealthOldUs = 2'500'000;
  /// Maximum numbers of daemons and of instruments shown. Daemons of the scene's instruments are
  /// dropped last.
  static constexpr std::size_t kMostShown = 16;

 private:
  struct Daemon {
    std::string state;
    std::optional<std::int64_t> reports_lost;  // none: not reported yet
    std::int64_t heard_us = 0;
  };

  bool HasInstrument(const std::string& name) const;
  std::string Devices(std::int64_t now_us) const;
  std::string ReportsLost() const;
  std::string Instruments(std::int64_t now_us) const;

  std::int64_t clock_id_;
  std::string scene_ = "no scene";
  bus::ActiveSimulators simulators_;
  std::map<std::string, Daemon> daemons_;  // by instrument
  std::int64_t samples_ = 0;
  std::int64_t states_ = 0;
  std::map<std::string, std::int64_t> command_sequences_;  // newest in a state, by instrument
  std::vector<double> latencies_ms_;
  double max_penetration_um_ = 0;  // since the last line, and of the state before it
  std::optional<torquer_lcm::wire_state_t> state_;
  std::int64_t state_heard_us_ = 0;
  std::map<std::string, double> readings_;
};

}  // namespace torquer::tools
