// Course of a session: instruments, pedals, wall force and solver over time, gathered from its
// messages. Memory use does not grow with the session.
#pragma once

#include <Eigen/Core>
#include <array>
#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "host/recorder/find_reading.h"
#include "host/recorder/session_series.h"
#include "torquer_lcm/instrument_command_t.hpp"
#include "torquer_lcm/readings_t.hpp"
#include "torquer_lcm/wire_state_t.hpp"

namespace torquer {

/// One instrument over time.
struct InstrumentCourse {
  std::string name;
  Series insertion_mm;
  Series rotation_deg;
  /// Number of times that its insertion reversed by more than SessionCourse::kReversalMm.
  std::int64_t reversals = 0;
};

/// Motion of the hands while the X-ray pedal was up.
struct BlindMotion {
  double path_mm = 0;  ///< insertions, both ways, of all instruments together
  double time_s = 0;   ///< time in which an instrument was pushed, pulled or turned
};

/// An injection by the power injector.
struct PowerInjection {
  double start_s = 0;    ///< of the order, simulated
  double volume_mL = 0;  ///< of the set-up
  double rate_mL_s = 0;  ///< of the set-up
  double delivered_mL = 0;
  bool aborted = false;
  bool complete() const { return !aborted && delivered_mL >= volume_mL; }
};

/// Solver outcomes, counted over the ticks of the log.
struct SolverHealth {
  std::int64_t ticks = 0;
  std::int64_t unconverged = 0;            ///< not within the scene's tolerance
  std::int64_t budget_spent = 0;           ///< of these: the time budget was spent
  std::int64_t stalled = 0;                ///< of these: no step reduced the residual
  std::int64_t outside = 0;                ///< a node's center was beyond the wall
  std::int64_t left_model = 0;             ///< an instrument was held at an outlet
  std::int64_t snapped = 0;                ///< the tip snapped
  std::int64_t in_doubt = 0;               ///< sensor lifted, device or commands missing
  std::optional<double> largest_residual;  ///< of ticks that converged; dimensionless
};

/// Collector of the course. Times are simulated seconds since the simulator began.
class SessionCourse {
 public:
  /// Further instruments are ignored; no scene has more.
  static constexpr std::size_t kMostInstruments = 4;
  static constexpr std::size_t kMostPathPoints = 2000;
  /// Smaller motion of the tip counts as tremor or sensor steps, as in the assessment.
  static constexpr double kPathStepMm = 0.5;
  static constexpr double kReversalMm = 1;
  /// Later injections by the power injector are not listed; their volume still counts.
  static constexpr std::size_t kMostInjections = 100;
  /// The session's first motion: an instrument has moved farther than this since the start.
  static constexpr double kFirstMotionMm = 0.5;
  static constexpr double kFirstTurnRad = 0.1;
  /// Tip speed is the straight-line distance over this window, divided by the window.
  static constexpr double kSpeedWindowS = 0.1;
  /// The tip moves when it is faster than this.
  static constexpr double kRestingMmS = 0.5;

  /// Takes the pedals from the commands of the innermost instrument.
  void Add(const torquer_lcm::instrument_command_t& command);
  /// Adds a tick; each tick must be added only once. Tip of the innermost instrument, even if
  /// another one reaches farther.
  void Add(const torquer_lcm::wire_state_t& state);
  /// Readings of a tick that was not added before do not count.
  void Add(const torquer_lcm::readings_t& readings);

  double begin_s() const { return begin_s_; }  ///< of the first tick
  double end_s() const { return time_s_; }     ///< of the last tick
  const std::vector<InstrumentCourse>& instruments() const { return instruments_; }
  const Spans& xray() const { return xray_; }          ///< pedal down
  const Spans& contrast() const { return contrast_; }  ///< pedal down
  /// By the power injector, the first one first.
  const std::vector<PowerInjection>& injections() const { return injections_; }
  const BlindMotion& blind() const { return blind_; }
  /// Time at which an instrument first moved; nullopt if none did.
  const std::optional<double>& first_motion_s() const { return first_motion_s_; }
  /// Largest force of a patch in ticks that converged, mN; includes peaks between two messages.
  const Series& wall_force_mN() const { return wall_force_mN_; }
  /// The same in all other ticks, mN; these values do not count.
  const Series& unsettled_force_mN() const { return unsettled_force_mN_; }
  const Series& tip_speed_mm_s() const { return tip_speed_mm_s_; }
  double tip_path_mm() const { return tip_path_mm_; }  ///< in steps of kPathStepMm
  double peak_speed_mm_s() const { return peak_speed_mm_s_; }
  /// Mean tip speed, mm/s, over the time in which the tip moved; empty if it never did.
  std::optional<double> moving_speed_mm_s() const {
    return moving_s_ > 0 ? std::optional(moving_mm_ / moving_s_) : std::nullopt;
  }
  /// Positions of the tip, evenly spaced along its path; at most kMostPathPoints.
  const std::vector<Eigen::Vector3d>& tip_way_mm() const { return tip_way_mm_; }
  const SolverHealth& solver() const { return solver_; }

 private:
  // Data of a tick that the next tick needs.
  struct Tick {
    std::int64_t number = 0;
    std::int64_t clock_id = 0;
    std::int64_t publish_us = 0;
    bool converged = false;
    std::vector<torquer_lcm::instrument_state_t> instruments;
  };
  // Insertion at an instrument's last reversal; before its first motion, its initial insertion.
  struct Turn {
    std::optional<double> extreme_mm;
    int direction = 0;  // 0: it has not moved yet
  };

  // Pose of an instrument's hand at the start and at the newest tick.
  struct HandPoses {
    double start_mm = 0;
    double start_rad = 0;
    double now_mm = 0;
    double now_rad = 0;
  };

  void AddAt(double time_s, const Tick& tick);
  void FollowHands(double step_s, const Tick& tick);
  void FollowTip(double time_s, const Eigen::Vector3d& tip_mm);
  void KeepWay(const Eigen::Vector3d& tip_mm);
  void CountReversals(std::size_t instrument, double insertion_mm);
  void CountTick(const torquer_lcm::wire_state_t& state);
  void AddInjection(const torquer_lcm::readings_t& readings);
  void ReleaseSilentPedals(double now_s);

  std::optional<Tick> last_;
  double begin_s_ = 0;
  double time_s_ = 0;
  std::vector<InstrumentCourse> instruments_;
  std::array<Turn, kMostInstruments> turns_;
  std::array<std::optional<HandPoses>, kMostInstruments> hands_;
  BlindMotion blind_;
  std::optional<double> first_motion_s_;
  Spans xray_;
  Spans contrast_;
  std::vector<PowerInjection> injections_;
  std::optional<double> command_s_;  // time of the newest command
  Series wall_force_mN_;
  Series unsettled_force_mN_;
  double wall_force_ever_mN_ = 0;
  Series tip_speed_mm_s_;
  std::optional<Eigen::Vector3d> speed_from_mm_;
  double speed_from_s_ = 0;
  double peak_speed_mm_s_ = 0;
  double moving_mm_ = 0;
  double moving_s_ = 0;
  double tip_path_mm_ = 0;
  std::optional<Eigen::Vector3d> path_from_mm_;
  std::vector<Eigen::Vector3d> tip_way_mm_;
  double way_step_mm_ = kPathStepMm;
  SolverHealth solver_;
};

}  // namespace torquer
