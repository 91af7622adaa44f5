// The figures of a recorded session: what was lost, whether the wire went where the hand went, how
// late it was.
#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include "host/recorder/session_log.h"

namespace torquer {

/// Order statistics of a set of measurements; all 0 when there are none.
struct Distribution {
  std::int64_t count = 0;
  double p50 = 0;
  double p99 = 0;
  double max = 0;
};

/// Nearest-rank order statistics of `values`, which it reorders.
Distribution Distribute(std::vector<double>& values);

/// One direction of motion (axial or transverse), from the sensor to the wire.
struct MotionAgreement {
  std::int64_t sensor_counts = 0;  ///< that the sensor produced since the first sample
  std::int64_t held_counts = 0;    ///< of these while clutch held, sensor lifted or at fault
  double hand = 0;                 ///< the rest, calibrated; mm or rad
  double wire = 0;          ///< by how far the wire moved since its start, carried rest included
  double error_counts = 0;  ///< |wire - hand| in counts
};

/// Counts by which wire and hand may differ: the resolution of the sensor.
inline constexpr double kMotionToleranceCounts = 1.0;

/// What torquer-report prints. -1 where the log does not tell.
struct SessionReport {
  std::string scene;
  std::string scene_file;
  std::string method;
  double duration_s = 0;  ///< from the first sample to the last

  std::int64_t reports_sent = -1;      ///< made by the device, as the emulator tells
  std::int64_t reports_received = -1;  ///< by the daemon, as its health tells
  std::int64_t reports_lost = -1;      ///< sent less received; else gaps in the report numbers
  std::int64_t reports_unfetched =
      0;                            ///< of the lost: the device made the next before it was asked
  std::int64_t samples = 0;         ///< in the log
  std::int64_t commands = 0;        ///< in the log
  std::int64_t states = 0;          ///< in the log
  std::int64_t states_missing = 0;  ///< gaps in the ticks: lost by the bus or the logger
  std::int64_t undecodable = 0;

  MotionAgreement axial;     ///< counts, mm
  MotionAgreement rotation;  ///< counts, rad

  Distribution latency_ms;  ///< from the hand to the state that first shows it being published
  Distribution solve_us;    ///< relaxation time of each tick
  double max_penetration_um = 0;
  double residual = 0;  ///< of the last state
  int status = 0;       ///< of the last state, bits of WireStatus
  torquer_lcm::scene_description_t description;
  torquer_lcm::wire_state_t last_state;
  torquer_lcm::readings_t readings{};  ///< the last; without names where the scene has no observer

  /// No report was lost, and the wire went where the hand went.
  bool Good() const {
    return reports_lost == 0 && axial.error_counts <= kMotionToleranceCounts &&
           rotation.error_counts <= kMotionToleranceCounts;
  }
};

/// Gathers a SessionReport from the messages of a session in their recorded order.
class SessionReporter {
 public:
  /// `instrument` is the one whose wire is judged.
  explicit SessionReporter(std::string instrument);

  /// Handlers that feed this object; it must outlive them.
  SessionHandlers Handlers();

  /// Resolution of the sensor in the first sample, counts an inch; 0 before there is one.
  int cpi() const { return first_sample_ ? first_sample_->cpi : 0; }

  /// The figures of all messages so far. `motion_per_count` takes (axial, transverse) counts to
  /// (mm, rad): the calibration of the session.
  /// Throws UserError when a kind of message without which there is no report is missing.
  SessionReport Finish(const Eigen::Matrix2d& motion_per_count) const;

 private:
  void Add(const torquer_lcm::device_sample_t& sample);
  void Add(const torquer_lcm::instrument_command_t& command);
  void Add(const torquer_lcm::wire_state_t& state);
  void Add(const torquer_lcm::health_t& health);
  bool Held(const torquer_lcm::device_sample_t& sample) const;
  void JudgeMotion(const Eigen::Matrix2d& motion_per_count, SessionReport& report) const;
  void CountReports(SessionReport& report) const;

  std::string instrument_;
  std::optional<torquer_lcm::device_sample_t> first_sample_;
  std::optional<torquer_lcm::device_sample_t> last_sample_;
  std::optional<torquer_lcm::hand_motion_t> truth_;
  std::optional<torquer_lcm::wire_state_t> last_state_;
  std::optional<torquer_lcm::scene_description_t> scene_;
  torquer_lcm::readings_t readings_{};
  std::map<std::string, std::int64_t> daemon_counters_;
  bool last_held_ = false;
  std::int64_t resets_ = 0;
  std::int64_t command_clock_id_ = 0;
  std::int64_t command_origin_us_ = -1;
  bool command_doubtful_ = false;
  std::vector<double> latencies_ms_;
  std::vector<double> solve_us_;
  SessionReport report_;
};

/// Arc length of the published nodes, mm.
double ArcLengthMm(const torquer_lcm::wire_state_t& state);

}  // namespace torquer
