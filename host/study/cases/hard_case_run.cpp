#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <sstream>

#include "host/simulator/core/newton/newton_relaxation.h"
#include "host/simulator/core/paper/paper_relaxation.h"
#include "host/simulator/effects/contact/friction.h"
#include "host/study/cases/hard_cases.h"
#include "host/study/cases/wire_invariants.h"

namespace torquer::study {
namespace {

using Eigen::Vector3d;

// Allowed relative rise of the energy. No step should raise it, but pushing a wire off an unstable
// equilibrium does so slightly.
constexpr double kAllowedRise = 1e-3;

WireState StartOf(const HardScene& scene) {
  WireState state = WireState::Along(scene.model, scene.start_path, {scene.start_mm, 0});
  std::vector<Vector3d> tangents = state.tangents();
  const std::size_t given = std::min(scene.start_tangents.size(), tangents.size());
  std::copy_n(scene.start_tangents.begin(), given, tangents.begin());
  state.TurnDistal(scene.model, {tangents.rbegin(), tangents.rend()});
  state.UntwistFrames(scene.model);
  return state;
}

std::unique_ptr<Relaxation> MakeRelaxation(Way way, const HardScene& scene,
                                           const std::vector<EnergyTerm*>& terms) {
  if (way == Way::kPaper) {
    return std::make_unique<PaperRelaxation>(scene.model, *scene.field, scene.wall,
                                             PaperSettings{});
  }
  return std::make_unique<NewtonRelaxation>(scene.model, *scene.field, scene.wall, NewtonSettings{},
                                            terms);
}

// Depth of a straight wire in the wall.
double UnbentDepth(const HardScene& scene) {
  double length_mm = scene.start_mm;
  for (const InstrumentPoses& target : scene.script) {
    length_mm = std::max(length_mm, target[0].insertion_mm);
  }
  length_mm = std::min(length_mm, scene.model.max_length_mm());
  double radius_mm = 0;
  for (int k = 0; k < scene.model.max_segments(); ++k) {
    radius_mm = std::max(radius_mm, scene.model.radius_mm(k));
  }
  constexpr int kPoints = 1000;
  double deepest_mm = 0;
  for (int k = 0; k <= kPoints; ++k) {
    const Vector3d at =
        scene.model.sheath().point_mm + (length_mm * k / kPoints) * scene.model.sheath().direction;
    deepest_mm = std::max(deepest_mm, radius_mm - scene.field->Clearance(at));
  }
  return deepest_mm;
}

// Run of one case: the state, its checker and the outcome.
class HardRun {
 public:
  HardRun(HardScene scene, Way way, const std::function<void(int)>& watch)
      : scene_(std::move(scene)),
        way_(way),
        watch_(watch),
        friction_(0.1, 0.005, {scene_.model, scene_.wall}),
        terms_(way == Way::kNewtonWithFriction ? std::vector<EnergyTerm*>{&friction_}
                                               : std::vector<EnergyTerm*>{}),
        relaxation_(MakeRelaxation(way, scene_, terms_)),
        state_(StartOf(scene_)),
        checker_(scene_.model, *scene_.field, state_) {
    relaxation_->Restart(state_);
    // A wire that starts inside the wall may be deeper than any unbent wire.
    outcome_.tip_stands_off_mm = scene_.tip_stands_off_mm;
    outcome_.unbent_mm = std::max(
        UnbentDepth(scene_), checker_.DeepestPenetration(state_, scene_.wall.points_per_segment));
  }

  HardOutcome Run() {
    if (!Follow()) return outcome_;
    if (!ComeToRest()) return outcome_;
    if (!DrawOut()) return outcome_;
    if (scene_.start_mm == 0) BeginAnew();
    return outcome_;
  }

 private:
  bool Broken(const std::string& what) {
    std::ostringstream text;
    text << "tick " << outcome_.ticks << ": " << what;
    outcome_.broken = text.str();
    return true;
  }

  // Returns true if all checks passed.
  bool Tick(const InstrumentPoses& target, int units) {
    CountedBudget budget(units);
    report_ = relaxation_->Tick(target, budget, state_);
    const std::string broken =
        checker_.Check(target, report_, state_, scene_.wall.points_per_segment);
    if (!broken.empty()) Broken(broken);
    ++outcome_.ticks;
    if (watch_) watch_(outcome_.ticks);
    outcome_.converged += report_.converged;
    outcome_.snaps += report_.snapped;
    outcome_.deepest_mm = std::max(outcome_.deepest_mm, report_.max_penetration_mm);
    outcome_.longest_work = std::max(outcome_.longest_work, report_.work);
    outcome_.last_residual = report_.residual;
    if (report_.converged) {
      outcome_.at_rest_mm = std::max(outcome_.at_rest_mm, report_.max_penetration_mm);
      if (way_ == Way::kNewton && outcome_.broken.empty()) CheckBalance();
    }
    return outcome_.broken.empty();
  }

  void CheckBalance() {
    const double left = UnbalancedBend(scene_.model, *scene_.field, scene_.wall, state_);
    if (left <= 1.001 * report_.residual + 1e-7) return;
    std::ostringstream what;
    what << "at rest with residual " << report_.residual << ", the wall leaves a moment of " << left
         << " EI/mm unbalanced";
    Broken(what.str());
  }

  bool Follow() {
    for (const InstrumentPoses& target : scene_.script) {
      if (!Tick(target, scene_.units)) return false;
      if (first_.size() < 5) first_.push_back(HashState(state_));
    }
    return true;
  }

  // Runs single steps of Newton's method with the hand at rest.
  bool Step(const InstrumentPoses& target) {
    constexpr int kSteps = 10;
    for (int k = 0; k < kSteps && !report_.converged; ++k) {
      const double before = report_.relaxed_mJ();
      if (!Tick(target, 1)) return false;
      if (report_.actions != 0) continue;
      const double rise = (report_.relaxed_mJ() - before) / std::max(before, 1e-9);
      outcome_.worst_rise = std::max(outcome_.worst_rise, rise);
      if (rise <= kAllowedRise) continue;
      std::ostringstream what;
      what << "a step took the energy from " << before << " to " << report_.relaxed_mJ() << " mJ";
      return !Broken(what.str());
    }
    return true;
  }

  bool ComeToRest() {
    const InstrumentPoses last = scene_.script.back();
    // With small budgets the wire may not have reached the target yet.
    constexpr int kMostToArrive = 400;
    for (int k = 0; k < kMostToArrive && way_ != Way::kPaper && !report_.arrived(); ++k) {
      if (!Tick(last, 400)) return false;
    }
    for (int k = 0; k < scene_.settle_ticks && !outcome_.settled; ++k) {
      if (way_ == Way::kNewton && report_.carried[0].insertion_mm == 0 && !Step(last)) return false;
      if (!Tick(last, way_ == Way::kPaper ? 4 : 400)) return false;
      outcome_.settled = report_.converged;
    }
    return true;
  }

  bool DrawOut() {
    // A start laid along a path cannot be reproduced.
    const int most = scene_.start_mm > 0 ? 1 : 2000;
    for (int k = 0; k < most && (state_.insertion_mm() > 0 || state_.rotation_rad() != 0); ++k) {
      if (!Tick({0, 0}, scene_.start_mm > 0 ? scene_.units : 400)) return false;
    }
    return true;
  }

  // Repeats the first ticks: everything in between must have no lasting effect.
  void BeginAnew() {
    if (HashState(state_) != HashState(WireState(scene_.model))) {
      outcome_.broken = "drawn out and turned back, the wire differs from its initial state";
      return;
    }
    for (std::size_t k = 0; k < first_.size(); ++k) {
      Tick(scene_.script[k], scene_.units);
      if (HashState(state_) == first_[k]) continue;
      std::ostringstream what;
      what << "begun again, tick " << k << " gave another state than the first time";
      outcome_.broken = what.str();
      return;
    }
  }

  const HardScene scene_;
  const Way way_;
  const std::function<void(int)>& watch_;
  effects::Friction friction_;
  const std::vector<EnergyTerm*> terms_;
  const std::unique_ptr<Relaxation> relaxation_;
  WireState state_;
  TickChecker checker_;
  TickReport report_;
  HardOutcome outcome_;
  std::vector<std::uint64_t> first_;
};

}  // namespace

const char* NameOf(Way way) {
  switch (way) {
    case Way::kNewton:
      return "newton";
    case Way::kNewtonWithFriction:
      return "newton with friction";
    case Way::kPaper:
      return "paper";
  }
  return "";
}

double UnbalancedBend(const WireModel& model, const ClearanceField& field, const WallModel& wall,
                      const WireState& state) {
  const int n = state.segments();
  const auto tangent = [&](int i) {
    return i < 0 ? model.sheath().direction : state.tangents()[static_cast<std::size_t>(i)];
  };
  // Pull of joint j on the direction of either adjacent segment; it acts along the other segment.
  const auto pull = [&](int j) {
    if (j >= n) return 0.0;
    const double y = (tangent(j) - tangent(j - 1)).squaredNorm() / 2;
    return JointStiffness(model, state, j) * EvaluateBending(model.law(), y).slope;
  };
  // Torque of a joint with a curved rest shape about the axis of its proximal segment.
  const auto torque = [&](int j) {
    if (j == 0 || n - j >= model.first_straight_joint()) return 0.0;
    const Vector3d rest = RestDirection(model, state, j);
    const double y = (tangent(j) - rest).squaredNorm() / 2;
    const double slope = EvaluateBending(model.law(), y).slope;
    return JointStiffness(model, state, j) * slope * rest.cross(tangent(j)).dot(tangent(j - 1));
  };
  // A twisting moment at a joint acts along the binormal of its two tangents.
  const auto binormal = [&](int j) {
    return Vector3d(tangent(j - 1).cross(tangent(j)) / (1 + tangent(j - 1).dot(tangent(j))));
  };
  const int points = wall.points_per_segment;
  double largest = 0;
  double twisting = 0;  // twisting moment beyond the segment's distal joint, inclusive
  Vector3d beyond = Vector3d::Zero();  // force of the wall on all that is distal to the segment
  for (int i = n - 1; i >= 0; --i) {
    const double length = state.SegmentLength(model, i);
    Vector3d own = Vector3d::Zero();
    Vector3d lever = length * beyond;
    for (int part = 1; part <= points; ++part) {
      const double t = length * part / points;
      ClearanceSample sample;
      const Vector3d at =
          part == points ? state.nodes()[static_cast<std::size_t>(i) + 1]
                         : Vector3d(state.nodes()[static_cast<std::size_t>(i)] + t * tangent(i));
      field.EvaluateGradient(at, sample);
      const double depth = model.radius_mm(n - 1 - i) - sample.clearance_mm;
      if (!(depth > 0)) continue;
      const double stands_for = part == points ? NodeLength(model, state, i + 1) : length;
      const Vector3d force = wall.stiffness_N_mm2 * (stands_for / points) * depth * sample.gradient;
      own += force;
      lever += t * force;
    }
    // The last segment has no distal joint; all others must be straight at rest.
    const double turned = i + 1 < n ? torque(i + 1) : 0;
    const bool straight = n - i - 1 >= model.first_straight_joint() || i == n - 1;
    if (straight && n - i >= model.first_straight_joint()) {
      Vector3d total = lever + pull(i) * tangent(i - 1) - (twisting + turned) * binormal(i);
      if (i + 1 < n) total += pull(i + 1) * tangent(i + 1) - twisting * binormal(i + 1);
      const double moment = tangent(i).cross(total).norm();
      largest = std::max(largest, moment / model.rigidity_N_mm2(n - i));
    }
    twisting += turned;
    beyond += own;
  }
  return largest;
}

std::string Objection(const HardCase& hard, Way way, const HardOutcome& outcome) {
  if (!outcome.broken.empty()) return outcome.broken;
  const bool paper = way == Way::kPaper;
  const double depth_mm = paper ? outcome.deepest_mm : outcome.at_rest_mm;
  double allowed_mm =
      (paper ? hard.paper.deepest_mm : hard.deepest_mm).value_or(outcome.unbent_mm) +
      outcome.tip_stands_off_mm;
  if (paper && hard.paper.or_unbent) allowed_mm = std::max(allowed_mm, outcome.unbent_mm);
  std::ostringstream what;
  // Written so that NaN counts as too deep.
  if (!(depth_mm <= allowed_mm)) {
    what << depth_mm << " mm deep in the wall" << (paper ? "" : " at rest") << ", allowed are "
         << allowed_mm << ". ";
  }
  if ((paper ? hard.paper.settles : hard.settles) && !outcome.settled) {
    what << "the hand rests, but the wire does not come to rest: residual " << outcome.last_residual
         << ". ";
  }
  return what.str();
}

HardOutcome RunHardCase(const HardCase& hard, Way way, unsigned seed,
                        const std::function<void(int)>& watch) {
  std::mt19937 random(seed);
  HardScene scene = hard.make(random);
  if (way == Way::kPaper) scene.wall.points_per_segment = 1;
  return HardRun(std::move(scene), way, watch).Run();
}

}  // namespace torquer::study
