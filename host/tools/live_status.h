// How a running session fares, in a line. No I/O, no clock.
#pragma once

#include <cstdint>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include "torquer_lcm/device_sample_t.hpp"
#include "torquer_lcm/health_t.hpp"
#include "torquer_lcm/readings_t.hpp"
#include "torquer_lcm/scene_description_t.hpp"
#include "torquer_lcm/wire_state_t.hpp"

namespace torquer::tools {

/// Bits of wire_state_t::status that a person should know of, in words; "ok" for none.
std::string StatusWords(std::int32_t status);

/// Gathers messages, and tells about those since it was last asked.
class LiveStatus {
 public:
  /// `clock_id` is this process's clock; latencies by other clocks are left out.
  explicit LiveStatus(std::int64_t clock_id) : clock_id_(clock_id) {}

  void Add(const torquer_lcm::device_sample_t& sample);
  void Add(const torquer_lcm::wire_state_t& state);
  void Add(const torquer_lcm::scene_description_t& scene) { scene_ = scene.name; }
  /// What is worth a line of its own, or "".
  std::string Add(const torquer_lcm::health_t& health);
  /// The same: a new event of the wall force, or that the target is reached.
  std::string Add(const torquer_lcm::readings_t& readings);

  /// One line without its end: scene, rates, latency, length, residual, penetration, status, what
  /// the wire presses on the wall with where the scene measures it, device. `interval_s` is the
  /// time since the last call, > 0.
  std::string Line(double interval_s);

 private:
  std::int64_t clock_id_;
  std::string scene_ = "no scene";
  std::string device_state_ = "no daemon";
  std::int64_t reports_lost_ = 0;
  std::int64_t samples_ = 0;
  std::int64_t states_ = 0;
  std::int64_t command_sequence_ = -1;
  std::vector<double> latencies_ms_;
  double max_penetration_um_ = 0;
  std::optional<torquer_lcm::wire_state_t> state_;
  std::map<std::string, double> readings_;
};

}  // namespace torquer::tools
