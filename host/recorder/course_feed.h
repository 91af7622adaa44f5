// Feed of a course by a simulation in this process, in the messages that a live one publishes.
#pragma once

#include <cstdint>
#include <string>
#include <torquer_lcm/readings_t.hpp>
#include <torquer_lcm/wire_state_t.hpp>

#include "host/recorder/session_course.h"
#include "host/simulator/exchangeable_simulation.h"

namespace torquer {

/// Adds states, readings and pedals to a course.
class CourseFeed {
 public:
  /// `clock_id`: of the times below. `simulation` must outlive this.
  CourseFeed(const simulator::ExchangeableSimulation& simulation, std::int64_t clock_id)
      : simulation_(simulation), clock_id_(clock_id) {}

  /// Adds the present state and its readings.
  void AddState(std::int64_t now_us);
  /// Adds a command of the innermost instrument's hand. At least one state must come before it.
  void AddPedals(std::int64_t now_us, bool xray, bool contrast);
  void Add(const torquer_lcm::instrument_command_t& command) { course_.Add(command); }

  const SessionCourse& course() const { return course_; }
  const torquer_lcm::readings_t& readings() const { return readings_; }  ///< the newest

 private:
  const simulator::ExchangeableSimulation& simulation_;
  const std::int64_t clock_id_;
  torquer_lcm::wire_state_t state_{};
  torquer_lcm::readings_t readings_{};
  SessionCourse course_;
};

}  // namespace torquer
