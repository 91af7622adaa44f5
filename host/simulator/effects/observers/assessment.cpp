#include "host/simulator/effects/observers/assessment.h"

#include <algorithm>
#include <limits>
#include <utility>

#include "host/simulator/core/stack/instrument_stack.h"
#include "host/support/error.h"

namespace torquer::effects {

namespace {

// Thresholds for motions: smaller ones are hand tremor and sensor steps.
constexpr double kPathStepMm = 0.5;
constexpr double kRetractionMm = 2;
constexpr double kLookEveryS = 0.02;
// Depth in a branch from which the tip has entered it. At its mouth the tip may only touch the
// wall.
constexpr double kDeepMm = 5;
constexpr double kUnknown = std::numeric_limits<double>::quiet_NaN();

}  // namespace

void Assessment::CopyFrom(const Effect& twin) {
  const auto& from = dynamic_cast<const Assessment&>(twin);
  speed_ = from.speed_;
  time_s_ = from.time_s_;
  xray_s_ = from.xray_s_;
  path_mm_ = from.path_mm_;
  start_to_target_mm_ = from.start_to_target_mm_;
  tip_ = from.tip_;
  any_converged_ = from.any_converged_;
  since_look_s_ = from.since_look_s_;
  off_route_ = from.off_route_;
  wrong_vessels_ = from.wrong_vessels_;
  furthest_mm_ = from.furthest_mm_;
  nearest_mm_ = from.nearest_mm_;
  retracting_ = from.retracting_;
  retractions_ = from.retractions_;
  retracted_mm_ = from.retracted_mm_;
  insertion_mm_ = from.insertion_mm_;
  begun_ = from.begun_;
  reached_s_ = from.reached_s_;
}

void Assessment::Restart() {
  speed_ = SpeedTrace();
  time_s_ = xray_s_ = path_mm_ = since_look_s_ = 0;
  furthest_mm_ = nearest_mm_ = retracted_mm_ = insertion_mm_ = 0;
  off_route_ = retracting_ = begun_ = any_converged_ = false;
  wrong_vessels_ = retractions_ = 0;
  start_to_target_mm_ = 0;
  tip_.reset();
  reached_s_.reset();
}

void Assessment::Observe(const TickView& tick) {
  time_s_ = tick.time_s;
  if (tick.controls.xray) xray_s_ += tick.step_s;
  const double insertion_mm = tick.target[task_.instrument].insertion_mm;
  CountRetractions(insertion_mm);
  speed_.Add(tick.time_s, insertion_mm);
  // An instrument beside or around this one may reach farther.
  const Eigen::Vector3d tip = PointAt(rod_, tick.state.CurveOf(task_.instrument),
                                      tick.state.poses()[task_.instrument].insertion_mm);
  const Eigen::Vector3d at_rest = moving_ == nullptr ? tip : moving_->AtRest(tip);
  // The wire at the start has been relaxed, but its tick has no report.
  if (!tip_) {
    tip_ = at_rest;
    start_to_target_mm_ = WayToTargetMm(at_rest);
  }
  since_look_s_ += tick.step_s;
  if (!tick.report.converged) return;
  any_converged_ = true;
  FollowTip(at_rest);
}

// A tip that starts beside the route has the straight way to it in addition.
double Assessment::WayToTargetMm(const Eigen::Vector3d& tip) const {
  const vessel::Centerline::Nearest nearest = task_.route.NearestTo(tip);
  const double aside_mm =
      std::max(0.0, nearest.distance_mm - task_.route.At(nearest.s_mm).radius_mm);
  return task_.route.length_mm() - nearest.s_mm + aside_mm;
}

void Assessment::CountRetractions(double insertion_mm) {
  if (!begun_) {
    begun_ = true;
    furthest_mm_ = nearest_mm_ = insertion_mm_ = insertion_mm;
  }
  retracted_mm_ += std::max(0.0, insertion_mm_ - insertion_mm);
  insertion_mm_ = insertion_mm;
  if (retracting_) {
    nearest_mm_ = std::min(nearest_mm_, insertion_mm);
    if (insertion_mm > nearest_mm_ + kRetractionMm) {
      retracting_ = false;
      furthest_mm_ = insertion_mm;
    }
    return;
  }
  furthest_mm_ = std::max(furthest_mm_, insertion_mm);
  if (insertion_mm < furthest_mm_ - kRetractionMm) {
    retracting_ = true;
    ++retractions_;
    nearest_mm_ = insertion_mm;
  }
}

void Assessment::FollowTip(const Eigen::Vector3d& tip) {
  const double moved_mm = (tip - *tip_).norm();
  if (moved_mm >= kPathStepMm) {
    path_mm_ += moved_mm;
    tip_ = tip;
  }
  if (since_look_s_ < kLookEveryS) return;
  since_look_s_ = 0;
  if (OutsideRouteMm(tip) < 0) {
    off_route_ = false;
  } else if (!off_route_ && IsDeepInBranch(tip)) {
    off_route_ = true;
    ++wrong_vessels_;
  }
  const Eigen::Vector3d target = task_.route.At(task_.route.length_mm()).position_mm;
  if (!reached_s_ && (tip - target).norm() <= task_.target_radius_mm) reached_s_ = time_s_;
}

// Distance of a point from the lumen of the route, mm; negative in it.
double Assessment::OutsideRouteMm(const Eigen::Vector3d& point) const {
  const vessel::Centerline::Nearest nearest = task_.route.NearestTo(point);
  return nearest.distance_mm - task_.route.At(nearest.s_mm).radius_mm;
}

// True if the vessel of the tip runs outside the route's lumen for kDeepMm on both sides of the
// tip. The vessel of the target beyond the target is not a branch.
bool Assessment::IsDeepInBranch(const Eigen::Vector3d& tip) const {
  constexpr double kStepMm = 0.5;
  const vessel::CenterlinePlace place = task_.vessels.NearestTo(tip);
  if (place.curve == task_.target.curve) {
    const double onward =
        task_.route.At(task_.route.length_mm()).tangent.dot(task_.vessels.At(task_.target).tangent);
    if (onward * (place.s_mm - task_.target.s_mm) > 0) return false;
  }
  const vessel::Centerline& branch = task_.vessels.curves()[place.curve];
  for (double away_mm = 0; away_mm <= kDeepMm; away_mm += kStepMm) {
    for (const double s_mm : {place.s_mm - away_mm, place.s_mm + away_mm}) {
      if (OutsideRouteMm(branch.At(s_mm).position_mm) < 0) return false;
    }
  }
  return true;
}

// The forces of a tick that did not converge are not known: they leave the safety unknown.
double Assessment::SafeSuccess() const {
  if (!target_reached() || force_.largest_ever_mN() > task_.force_limit_mN) return 0;
  return force_.missed_any() ? kUnknown : 1;
}

std::vector<Reading> Assessment::Readings() const {
  const auto of_tip = [this](double value) { return any_converged_ ? value : kUnknown; };
  // A session that starts at the target has no way to compare with.
  const double path_ratio =
      start_to_target_mm_ > task_.target_radius_mm ? path_mm_ / start_to_target_mm_ : kUnknown;
  return {{"procedure_s", time_s_},
          {"fluoroscopy_s", xray_s_},
          {"tip_path_mm", of_tip(path_mm_)},
          {"tip_path_ratio", of_tip(path_ratio)},
          {"retractions", static_cast<double>(retractions_)},
          {"retracted_mm", retracted_mm_},
          {"wrong_vessel_entries", of_tip(wrong_vessels_)},
          {"mean_speed_mm_s", speed_.mean_moving_mm_s()},
          {"submovements", static_cast<double>(speed_.submovements())},
          {"log_dimensionless_jerk", speed_.log_dimensionless_jerk()},
          {"wall_force_max_mN", force_.largest_ever_mN()},
          {"wall_impulse_mNs", force_.impulse_mNs()},
          {"target_reached", of_tip(target_reached() ? 1 : 0)},
          {"target_reached_s", of_tip(reached_s_.value_or(kUnknown))},
          {"safe_success", of_tip(SafeSuccess())}};
}

namespace {

struct AssessmentSpec : TableSpec {
  std::string target_centerline;
  double target_at_mm = 0;
  double target_radius_mm = 3;
  double force_limit_mN = 0;
  std::optional<std::string> instrument;
};

const Keys<AssessmentSpec>& AssessmentKeys() {
  static const Keys<AssessmentSpec> keys =
      Keys<AssessmentSpec>()
          .Required()
          .Text("target_centerline", &AssessmentSpec::target_centerline,
                "centerline on which the target lies")
          .Required()
          .Number("target_at_mm", &AssessmentSpec::target_at_mm, 0, 1e5, "mm",
                  "arc length of the target along its centerline")
          .Number("target_radius_mm", &AssessmentSpec::target_radius_mm, 0.1, 50, "mm",
                  "distance from the target within which the tip has reached it")
          .Required()
          .Number("force_limit_mN", &AssessmentSpec::force_limit_mN, 0.01, 1e5, "mN",
                  "largest force on a patch of wall_force in a safe success")
          .Otherwise("the innermost instrument")
          .Text("instrument", &AssessmentSpec::instrument,
                "instrument that is assessed: its tip, and the speed and retractions of its hand")
          .Example(
              "target_centerline = \"lad\"\n"
              "target_at_mm = 95\n"
              "force_limit_mN = 100\n");
  return keys;
}

std::unique_ptr<Effect> MakeAssessment(const AssessmentSpec& spec, const EffectContext& context) {
  if (context.centerlines == nullptr || context.centerlines->empty()) {
    spec.origin.Refuse("target_centerline",
                       "this vessel has no centerlines; give vessel.centerlines, or remove "
                       "[effects.assessment]");
  }
  const int instrument =
      spec.instrument ? context.FindInstrument(*spec.instrument, spec, "instrument") : 0;
  // An instrument that lies beside the others has its own entry.
  const WireModel& assessed =
      context.stack == nullptr ? context.wire : context.stack->instrument(instrument);
  const vessel::CenterlineNetwork& network = *context.centerlines;
  AssessmentTask task = [&] {
    try {
      const vessel::CenterlinePlace target =
          network.Place(spec.target_centerline, spec.target_at_mm);
      return AssessmentTask{network.Path(network.NearestTo(assessed.sheath().point_mm), target),
                            network, target};
    } catch (const UserError& error) {
      spec.origin.Refuse("target_centerline", error.what());
    }
  }();
  task.target_radius_mm = spec.target_radius_mm;
  task.force_limit_mN = spec.force_limit_mN;
  task.instrument = instrument;
  return std::make_unique<Assessment>(std::move(task), *FindEarlier<WallForce>(context),
                                      context.wire, context.moving);
}

}  // namespace

EffectKind AssessmentKind() {
  return {.name = "assessment",
          .summary = "clinical metrics of a session: times, path length, speed, force, success",
          .roles = "observer",
          .keys = Any(AssessmentKeys()),
          .needs = "wall_force",
          .make = MakeWith(MakeAssessment)};
}

}  // namespace torquer::effects
