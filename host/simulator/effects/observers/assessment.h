// Assessment of a trainee: the usual measures of endovascular skill.
#pragma once

#include <Eigen/Core>
#include <optional>
#include <utility>
#include <vector>

#include "host/simulator/core/wire_model.h"
#include "host/simulator/effects/effect.h"
#include "host/simulator/effects/observers/speed_trace.h"
#include "host/simulator/effects/observers/wall_force.h"
#include "host/simulator/vessel/centerline.h"

namespace torquer::effects {

/// Criteria of a session.
struct AssessmentTask {
  vessel::Centerline route;  ///< from the instrument's entry to the target
  /// All vessels, with those of the route; must outlive the assessment.
  const vessel::CenterlineNetwork& vessels;
  vessel::CenterlinePlace target;  ///< the route's end
  double target_radius_mm = 3;     ///< reached within this distance of the route's end
  double force_limit_mN = 0;       ///< of a single contact
  int instrument = 0;              ///< the instrument whose hand and tip are assessed
};

/// Measures of a session. Hand and tip are those of the task's instrument, even if another one
/// reaches farther. The force is the largest of all instruments. The tip and the force count only
/// in ticks that converged, so their measures are unknown (NaN) until then. The hand and the pedals
/// count in all ticks.
class Assessment final : public Effect, public Observer {
 public:
  /// `rod`: that of all instruments. `moving`: the moving vessel, or null; the tip's path is
  /// measured relative to it. These and `force` must outlive this.
  Assessment(AssessmentTask task, const WallForce& force, const WireModel& rod,
             const vessel::MovingField* moving = nullptr)
      : task_(std::move(task)), force_(force), rod_(rod), moving_(moving) {}

  Observer* observer() override { return this; }
  void Restart() override;
  void CopyFrom(const Effect& twin) override;
  void Observe(const TickView& tick) override;
  std::vector<Reading> Readings() const override;

  const AssessmentTask& task() const { return task_; }
  bool target_reached() const { return reached_s_.has_value(); }
  int wrong_vessels() const { return wrong_vessels_; }
  double tip_path_mm() const { return path_mm_; }

 private:
  void FollowTip(const Eigen::Vector3d& tip);
  double SafeSuccess() const;
  double WayToTargetMm(const Eigen::Vector3d& tip) const;
  void CountRetractions(double insertion_mm);
  double OutsideRouteMm(const Eigen::Vector3d& point) const;
  bool IsDeepInBranch(const Eigen::Vector3d& tip) const;

  const AssessmentTask task_;
  const WallForce& force_;
  const WireModel& rod_;
  const vessel::MovingField* const moving_;
  SpeedTrace speed_;
  double time_s_ = 0;
  double xray_s_ = 0;
  double path_mm_ = 0;
  double start_to_target_mm_ = 0;       // along the route, from the tip at the start
  std::optional<Eigen::Vector3d> tip_;  // last point of the measured path
  bool any_converged_ = false;
  double since_look_s_ = 0;
  bool off_route_ = false;
  int wrong_vessels_ = 0;
  double furthest_mm_ = 0;  // largest insertion since the last retraction ended
  double nearest_mm_ = 0;   // smallest insertion since the last retraction began
  bool retracting_ = false;
  int retractions_ = 0;
  double retracted_mm_ = 0;
  double insertion_mm_ = 0;
  bool begun_ = false;
  std::optional<double> reached_s_;
};

EffectKind AssessmentKind();

}  // namespace torquer::effects
