// Session report: lost messages, agreement of each instrument with its hand, and latency.
#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <deque>
#include <functional>
#include <limits>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include "host/recorder/log_gaps.h"
#include "host/recorder/pass_marks.h"
#include "host/recorder/session_course.h"
#include "host/recorder/session_log.h"

namespace torquer {

/// Order statistics of a set of measurements; NaN when there are none.
struct Distribution {
  std::int64_t count = 0;
  double p50 = std::numeric_limits<double>::quiet_NaN();
  double p99 = std::numeric_limits<double>::quiet_NaN();
  double p999 = std::numeric_limits<double>::quiet_NaN();
  double max = std::numeric_limits<double>::quiet_NaN();
};

/// Computes nearest-rank order statistics of `values` and reorders them.
Distribution Distribute(std::vector<double>& values);

/// Motion in one direction (axial or transverse), from the sensor to the wire.
struct MotionAgreement {
  std::int64_t sensor_counts = 0;  ///< counts of the sensor since the first sample
  std::int64_t held_counts = 0;    ///< of these while clutch held, sensor lifted or at fault
  double hand = 0;                 ///< the rest, calibrated; mm or rad
  double wire = 0;          ///< motion of the wire since its start, carried remainder included
  double error_counts = 0;  ///< |wire - hand - healed| in counts
};

/// Allowed difference between wire and hand in counts: the resolution of the sensor.
inline constexpr double kMotionToleranceCounts = 1.0;

/// Instrument and the device that drove it. Empty values are not known.
struct InstrumentReport {
  std::string name;
  std::string device;                            ///< serial number; empty: no device drove it
  std::optional<std::int64_t> reports_sent;      ///< made by the device, by the emulator's count
  std::optional<std::int64_t> reports_received;  ///< received by the daemon, by its health
  std::optional<std::int64_t> reports_lost;      ///< sent less received, or gaps in their numbers
  /// Lost reports that the next one replaced before the host fetched them, by the emulator's count.
  std::optional<std::int64_t> reports_unfetched;
  std::int64_t samples = 0;         ///< in the log
  std::int64_t resets = 0;          ///< restarts of the device, by its samples
  std::int64_t commands = 0;        ///< in the log
  double duration_s = 0;            ///< from its first sample to its last
  std::optional<double> healed_mm;  ///< lost motion that was corrected at the end switch
  MotionAgreement axial;            ///< counts, mm
  MotionAgreement rotation;         ///< counts, rad
  Distribution latency_ms;          ///< from hand motion to publishing of the first state with it

  bool driven() const { return !device.empty(); }
  /// No report was lost, and the instrument went where the hand went.
  bool Good() const {
    return reports_lost == 0 && axial.error_counts <= kMotionToleranceCounts &&
           rotation.error_counts <= kMotionToleranceCounts;
  }
};

/// Run of a script that reaches the scene's target well.
struct ExpertRun {
  std::string file;                    ///< script of the run
  torquer_lcm::readings_t readings{};  ///< at its end
  SessionCourse course;
};

/// Exchange of an instrument for another device.
struct ReportExchange {
  double time_s = 0;  ///< simulated
  std::string instrument;
  std::string device;
};

/// Report that torquer-report prints.
struct SessionReport {
  std::string scene;
  std::string scene_file;
  std::string method;
  /// From the first sample of any device to the last; without devices from the first state to the
  /// last.
  double duration_s = 0;

  std::vector<InstrumentReport> instruments;  ///< the innermost first

  std::int64_t states = 0;            ///< in the log
  std::int64_t shapes = 0;            ///< of these: with the full curve, not only its ends
  std::int64_t states_missing = 0;    ///< gaps in the ticks: lost by the bus or the logger
  std::int64_t undecodable = 0;       ///< messages that are not of their channel's type
  std::vector<std::string> gaps;      ///< missing messages, as LogGaps describes them
  std::vector<std::string> silences;  ///< late or missing periodic messages (LogGaps)
  std::map<std::string, std::int64_t> unknown;  ///< counts by unknown TORQUER... channel
  LogDamage damage;                             ///< of the log
  bool ended = false;                           ///< the log holds the end of every daemon
  std::int64_t started_us = 0;  ///< the logger's wall clock at its first record; 0: unknown

  Distribution solve_us;  ///< relaxation time of each tick
  double max_penetration_um = 0;
  double residual = 0;  ///< of the last state
  int status = 0;       ///< of the last state, bits of WireStatus
  torquer_lcm::scene_description_t description;
  torquer_lcm::wire_state_t last_state;  ///< last state with a shape; motion is graded by it
  std::int64_t ticks_after_shape = 0;    ///< ticks in the log after `last_state`
  std::int64_t first_tick = 0;  ///< first tick of the log; if not 0, motion is graded from there
  torquer_lcm::readings_t readings{};  ///< last readings; no names without an observer

  std::vector<ReportExchange> exchanges;  ///< of instruments, in their order

  SessionCourse course;
  SolverHealth solver;  ///< of the live session
  /// True if `readings` and `course` are from a replay at full accuracy, not from the live session.
  bool judged = false;
  bool examination = false;  ///< set by the caller; otherwise practice
  std::string trainee;       ///< set by the caller; "": not named
  std::string group;         ///< of the trainee, set by the caller; "": none
  /// Reason why the session has no marks; "" if it has marks, or if the scene has no measures.
  std::string not_gradable;
  std::optional<MarkSheet> marks;   ///< none: no pass marks are set for the scene
  std::optional<ExpertRun> expert;  ///< for comparison; none: the scene has none

  /// True if the scene names this effect, such as "fluoroscopy".
  bool Has(const std::string& effect) const;
  /// True if every instrument driven by a device is good and the log is complete.
  bool Good() const;
};

/// Gathers a SessionReport from the messages of a session in their recorded order.
class SessionReporter {
 public:
  /// Calibration of a device: maps (axial, transverse) counts to (mm, rad). `cpi`: resolution of
  /// its sensor in the first sample, counts per inch.
  using MotionPerCount = std::function<Eigen::Matrix2d(const std::string& device, int cpi)>;

  /// Handlers that feed this object, which must outlive them.
  SessionHandlers Handlers();

  /// Returns the figures of all messages so far. Throws UserError if a required message type is
  /// missing.
  SessionReport Finish(const MotionPerCount& motion_per_count) const;

 private:
  // Motion of the hand from the first sample to a later one.
  struct Motion {
    std::int64_t origin_us = 0;
    MotionAgreement axial;
    MotionAgreement rotation;
  };

  // Data gathered for one instrument.
  struct Channel {
    std::optional<torquer_lcm::device_sample_t> first_sample;
    std::optional<torquer_lcm::device_sample_t> last_sample;
    std::map<std::string, std::int64_t> daemon_counters;
    std::optional<torquer_lcm::hand_motion_t> truth;  // at or just before the daemon's counters
    std::int64_t counted_us = -1;                     // time of the daemon's counters
    bool ended = false;                               // the daemon reported that it stops
    std::deque<Motion> recent;                        // samples later than the last state shows
    Motion shown;                                     // motion that the last state shows
    Motion shown_with_shape;      // motion that the last state with a shape shows
    std::optional<Motion> begin;  // motion at the first shape that shows a sample of the log
    Eigen::Vector2d begin_wire = Eigen::Vector2d::Zero();  // position of the wire then, mm and rad
    std::optional<std::int64_t> first_healed_um;           // first value from the daemon
    bool last_held = false;
    std::int64_t command_clock_id = 0;
    std::int64_t command_origin_us = -1;
    bool command_doubtful = false;
    std::int64_t shown_sequence = -1;  // newest command in a state
    std::vector<double> latencies_ms;
    InstrumentReport report;
  };

  void Add(const torquer_lcm::device_sample_t& sample);
  void Add(const torquer_lcm::instrument_command_t& command);
  void Add(const torquer_lcm::wire_state_t& state);
  void Add(const torquer_lcm::readings_t& readings);
  void Add(const torquer_lcm::devices_t& devices);
  void Add(const torquer_lcm::health_t& health);
  void Add(const torquer_lcm::hand_motion_t& truth);
  static bool Held(const Channel& channel, const torquer_lcm::device_sample_t& sample);
  static void CountReports(const Channel& channel, InstrumentReport& report);
  bool MovedOn(const torquer_lcm::hand_motion_t& truth) const;
  static void Show(Channel& channel, std::int64_t origin_us);
  void TakeShape(const torquer_lcm::wire_state_t& state);
  void JudgeMotion(const Channel& channel, std::size_t index, const Eigen::Matrix2d& per_count,
                   InstrumentReport& report) const;

  std::map<std::string, Channel> channels_;                   // by instrument
  std::map<std::string, torquer_lcm::hand_motion_t> truths_;  // by device
  std::int64_t first_state_us_ = 0;
  std::int64_t first_tick_ = 0;
  std::optional<torquer_lcm::wire_state_t> last_state_;
  std::optional<torquer_lcm::wire_state_t> last_shape_;  // last state with a shape
  std::optional<torquer_lcm::scene_description_t> scene_;
  std::vector<ReportExchange> exchanges_;
  torquer_lcm::readings_t readings_{};
  std::vector<double> solve_us_;
  SessionCourse course_;
  LogGaps gaps_;
  SessionReport report_;
};

/// Arc length along the published nodes of an instrument's curve up to its tip, mm.
double ArcLengthMm(const torquer_lcm::wire_state_t& state, std::size_t instrument);

}  // namespace torquer
