// The status of a running session in a line. No I/O, no clock.
#pragma once

#include <cstdint>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include "host/bus/sender.h"
#include "host/bus/simulators_heard.h"
#include "torquer_lcm/device_sample_t.hpp"
#include "torquer_lcm/health_t.hpp"
#include "torquer_lcm/readings_t.hpp"
#include "torquer_lcm/scene_description_t.hpp"
#include "torquer_lcm/wire_state_t.hpp"

namespace torquer::tools {

/// Bits of wire_state_t::status that matter to a person, in words; "ok" for none.
std::string StatusWords(std::int32_t status);

/// Gathers messages, and describes those since it was last asked. What has not come for some time
/// is shown as that old, and not as the present state. All text of messages comes out Printable.
///
/// `now_us` is the time of the call, by bus::MonotonicUs(), ascending.
class LiveStatus {
 public:
  /// `clock_id` is this process's clock; latencies by other clocks are left out.
  explicit LiveStatus(std::int64_t clock_id) : clock_id_(clock_id) {}

  void Add(const torquer_lcm::device_sample_t& sample);
  void Add(const torquer_lcm::wire_state_t& state, const bus::Sender& sender, std::int64_t now_us);
  void Add(const torquer_lcm::scene_description_t& scene, const bus::Sender& sender);
  /// A line about what has changed, or "".
  std::string Add(const torquer_lcm::health_t& health, std::int64_t now_us);
  /// The same: a new event of the wall force, or that the target was reached.
  std::string Add(const torquer_lcm::readings_t& readings);

  /// One line without its end: scene, place of each instrument, status, wall force where the scene
  /// measures it, devices, rates, latency, residual, penetration. `interval_s` is the time since
  /// the last call, > 0.
  std::string Line(double interval_s, std::int64_t now_us);

  /// A state is published five times a second at least, health once a second.
  static constexpr std::int64_t kStateOldUs = 1'000'000;
  static constexpr std::int64_t kHealthOldUs = 2'500'000;
  /// Most daemons and instruments that are shown. A daemon of an instrument of the scene goes last.
  static constexpr std::size_t kMostShown = 16;

 private:
  struct Daemon {
    std::string state;
    std::int64_t reports_lost = 0;
    std::int64_t heard_us = 0;
  };

  bool HasInstrument(const std::string& name) const;
  std::string Devices(std::int64_t now_us) const;
  std::string Instruments(std::int64_t now_us) const;

  std::int64_t clock_id_;
  std::string scene_ = "no scene";
  bus::SimulatorsHeard simulators_;
  std::map<std::string, Daemon> daemons_;  // by instrument
  std::int64_t samples_ = 0;
  std::int64_t states_ = 0;
  std::map<std::string, std::int64_t> command_sequences_;  // newest in a state, by instrument
  std::vector<double> latencies_ms_;
  double max_penetration_um_ = 0;
  std::optional<torquer_lcm::wire_state_t> state_;
  std::int64_t state_heard_us_ = 0;
  std::map<std::string, double> readings_;
};

}  // namespace torquer::tools
