#include "host/study/cases/scene_run.h"

#include <algorithm>
#include <cmath>
#include <memory>
#include <numeric>
#include <optional>
#include <sstream>
#include <utility>
#include <vector>

#include "host/simulator/simulation.h"
#include "host/study/cases/wire_invariants.h"

namespace torquer::study {
namespace {

using Eigen::Vector3d;
using simulator::Command;
using simulator::Simulation;

// Allowed relative rise of the energy over a step. Pushing a wire off an unstable equilibrium, and
// pairing two curves again at rest, raise it slightly.
constexpr double kAllowedStackRise = 1e-2;
// Ticks that a twin and a second start repeat.
constexpr std::size_t kRepeated = 5;

// Point of a polyline that is nearest to a given point.
struct Nearest {
  double distance_mm = 1e9;
  double arc_mm = 0;
  std::size_t segment = 0;
  bool is_begin = false;  // the beginning of the first segment that was searched
};

// Nearest point of the segments from number `from` on.
Nearest NearestOn(const Curve& curve, const Vector3d& point, std::size_t from = 0) {
  Nearest nearest;
  double arc_mm = 0;
  for (std::size_t i = 0; i + 1 < curve.nodes().size(); ++i) {
    const Vector3d leg = curve.nodes()[i + 1] - curve.nodes()[i];
    const double along =
        std::clamp((point - curve.nodes()[i]).dot(leg) / leg.squaredNorm(), 0.0, 1.0);
    const double distance_mm = (point - curve.nodes()[i] - along * leg).norm();
    if (i >= from && distance_mm < nearest.distance_mm) {
      nearest = {distance_mm, arc_mm + along * leg.norm(), i, i == from && along == 0};
    }
    arc_mm += leg.norm();
  }
  return nearest;
}

// Distance of the arcs near a segment from their chords, mm.
double BulgeAt(const WireModel& rod, const Curve& curve, std::size_t segment) {
  const std::vector<Vector3d>& tangents = curve.tangents();
  double turn = 0;
  for (std::size_t i = segment; i < std::min(segment + 2, tangents.size()); ++i) {
    // At the sheath, the whole turn lies within the first segment.
    turn = std::max(turn, i == 0 ? 2 * (tangents[0] - rod.sheath().direction).norm()
                                 : (tangents[i] - tangents[i - 1]).norm());
  }
  return turn * (curve.nodes()[segment + 1] - curve.nodes()[segment]).norm() / 8;
}

// True if the curve has a bend whose radius is less than the diameter of its lumen. Nearest points
// jump there, and the contact is undefined.
bool BendsSharply(const WireModel& rod, const Curve& curve, double lumen_mm) {
  for (std::size_t i = 0; i < curve.tangents().size(); ++i) {
    const Vector3d& before = i == 0 ? rod.sheath().direction : curve.tangents()[i - 1];
    const double bend_mm = JointLength(rod, curve, static_cast<int>(i));
    if ((curve.tangents()[i] - before).norm() * 2 * lumen_mm > bend_mm) return true;
  }
  return false;
}

class SceneRun {
 public:
  SceneRun(scene::Scene& scene, std::mt19937& random)
      : scene_(scene), random_(random), session_(scene), evolves_(session_.is_time_dependent()) {
    command_.target = session_.target();
  }

  SceneOutcome Run(int moves) {
    for (int move = 0; move < moves && IsWhole(); ++move) {
      if (move == moves / 2) MakeTwin();
      Move(move == moves / 2 + 1);
    }
    twin_.reset();
    if (IsWhole()) ComeToRest();
    if (IsWhole()) DrawOut();
    if (IsWhole()) BeginAnew();
    return std::move(outcome_);
  }

 private:
  bool IsWhole() const { return outcome_.broken.empty(); }
  double Between(double low, double high) {
    return std::uniform_real_distribution<double>(low, high)(random_);
  }
  template <class... Parts>
  void Object(const Parts&... parts) {
    if (!IsWhole()) return;
    std::ostringstream text;
    text << "tick " << outcome_.ticks << ": ";
    (text << ... << parts);
    outcome_.broken = text.str();
  }

  // New targets, and some ticks towards them with a budget that is drawn once.
  void Move(bool all_out) {
    const int instruments = command_.target.size();
    const double reach = std::exp(Between(std::log(0.05), std::log(20)));
    for (int k = 0; k < instruments; ++k) {
      double& insertion_mm = command_.target[k].insertion_mm;
      insertion_mm += reach * Between(-0.7, 1);
      insertion_mm = std::clamp(insertion_mm, -5.0, 140.0);
      if (all_out) insertion_mm = 0;
      command_.target[k].rotation_rad += 0.3 * reach * Between(-1, 1);
    }
    command_.controls.contrast = random_() % 2 == 0;
    command_.in_doubt = random_() % 20 == 0;
    const int units = static_cast<int>(std::exp(Between(0, std::log(200))));
    const int ticks = 1 + static_cast<int>(random_() % 40);
    for (int k = 0; k < ticks && IsWhole(); ++k) Tick(units);
  }

  void Tick(int units) {
    CountedBudget budget(units);
    const TickReport& report = session_.Tick(command_, budget);
    ++outcome_.ticks;
    outcome_.converged += report.converged;
    outcome_.snaps += report.snapped;
    outcome_.deepest_mm = std::max(outcome_.deepest_mm, report.max_penetration_mm);
    outcome_.last_residual = report.residual;
    CheckGeometry();
    CheckReport(report);
    CheckForces();
    if (report.converged && report.arrived()) CheckContacts();
    if (hashes_.size() < kRepeated) {
      commands_.push_back(command_);
      units_.push_back(units);
      hashes_.push_back(session_.state_hash());
    }
    if (twin_) RepeatInTwin(units);
  }

  void CheckGeometry() {
    const WireState& state = session_.state();
    for (int c = 0; c < state.curves(); ++c) {
      const std::string broken = BrokenGeometry(scene_.stack().empty_rod(c), state.curve(c));
      if (!broken.empty()) Object("curve ", c, ": ", broken);
    }
  }

  void CheckReport(const TickReport& report) {
    if (!std::isfinite(report.energy_mJ) || !std::isfinite(report.dissipated_mJ) ||
        !std::isfinite(report.residual) || !std::isfinite(report.max_penetration_mm)) {
      Object("energy ", report.energy_mJ, ", dissipated ", report.dissipated_mJ, ", residual ",
             report.residual, ", penetration ", report.max_penetration_mm);
    }
    const WireState& state = session_.state();
    const InstrumentPoses goal = session_.goal();
    for (int c = 0; c < state.curves(); ++c) {
      // A curve reaches as far as the farthest of its instruments.
      const auto [first, last] = scene_.stack().OnCurve(c);
      double reach_mm = 0;
      for (int k = first; k < last; ++k) {
        reach_mm = std::max(reach_mm, goal[k].insertion_mm - report.carried[k].insertion_mm);
      }
      if (!(std::abs(reach_mm - state.curve(c).insertion_mm()) < 1e-9)) {
        Object("curve ", c, " reaches ", state.curve(c).insertion_mm(),
               " mm; its hands account for ", reach_mm);
      }
    }
  }

  void CheckForces() {
    // Forces of a tick that did not converge are not known.
    const bool known = session_.report().converged;
    const auto are_finite = [known](const std::vector<double>& values) {
      return std::all_of(values.begin(), values.end(),
                         [known](double v) { return known ? std::isfinite(v) : std::isnan(v); });
    };
    if (const InternalForces* forces = session_.forces(); forces != nullptr) {
      for (const Vector3d& force : forces->contact_N) {
        if (known != force.allFinite()) Object("a contact force is ", force.transpose());
      }
      if (!are_finite(forces->line_load_N_mm) || !are_finite(forces->tension_N) ||
          !are_finite(forces->bending_mJ) || !are_finite(forces->twisting_mJ)) {
        Object("an internal force is not finite, or known without convergence");
      }
      for (const double load : forces->line_load_N_mm) {
        if (load < 0) Object("a line load is ", load);
      }
    }
    for (const effects::Reading& reading : session_.Readings()) {
      if (std::isinf(reading.value)) Object("reading ", reading.name, " is ", reading.value);
    }
  }

  // At rest, the contacts have at least the energy of the overlaps of nearest points. An overlap
  // without a contact has none.
  void CheckContacts() {
    const WireState& state = session_.state();
    double least_mJ = 0;
    bends_sharply_ = false;
    for (int c = 0; c < state.curves(); ++c) {
      if (scene_.stack().clearance().touches_itself) least_mJ += EnergyBeside(c, c);
      for (int outer = c + 1; outer < state.curves(); ++outer) {
        const bool beside = scene_.stack().AreBeside(c, outer);
        if (state.curve(outer).segments() == 0) continue;
        if (beside || scene_.stack().clearance().touches_itself) {
          least_mJ += EnergyBeside(c, outer);
        }
        if (scene_.stack().CurveAround(c) == outer) least_mJ += EnergyInLumen(c, outer);
      }
    }
    outcome_.sharp_bends += bends_sharply_;
    if (bends_sharply_) return;
    double found_mJ = 0;
    for (const BetweenCurves& between : session_.relaxation().Current().between) {
      found_mJ += between.energy_mJ;
    }
    constexpr double kFactor = 3;  // between nearest points and the places of the contacts
    if (least_mJ > kFactor * found_mJ + 1e-4) {
      Object("instruments overlap by ", least_mJ, " mJ of contact; the contacts have ", found_mJ);
    }
  }

  // Places at rest.
  InstrumentPoses Places() const { return scene_.stack().Bounded(command_.target); }
  // Radius of a curve. At the tip of an instrument it grows over one segment.
  double SurfaceRadius(int curve, double arc_mm) const {
    const double beyond_mm = arc_mm + scene_.stack().empty_rod().segment_mm();
    const int k = scene_.stack().SurfaceAt(curve, Places(), beyond_mm);
    return OuterRadius(scene_.spec().instruments[static_cast<std::size_t>(k)]);
  }
  double LumenRadius(int curve, double arc_mm) const {
    const auto k = static_cast<std::size_t>(scene_.stack().LumenAt(curve, Places(), arc_mm));
    return scene_.stack().clearance().lumen_radius_mm[k];
  }
  double Bulges(int curve, std::size_t segment, int other, std::size_t other_segment) const {
    const WireState& state = session_.state();
    return BulgeAt(scene_.stack().empty_rod(curve), state.curve(curve), segment) +
           BulgeAt(scene_.stack().empty_rod(other), state.curve(other), other_segment);
  }
  // Energy of the overlap in the middle of a segment. Contacts at the places of a segment can miss
  // an overlap near its ends, and a shallow one between them.
  double ContactEnergy(double begin_mm, double end_mm, double length_mm) const {
    constexpr double kShallow = 0.02;  // in parts of the segment
    const double overlap_mm = std::max(0.0, (begin_mm + end_mm) / 2 - kShallow * length_mm);
    return scene_.stack().clearance().stiffness_N_mm2 * length_mm * overlap_mm * overlap_mm / 2;
  }

  // The curve around a curve at an arc length, by the lengths of both. In the vessel it is the
  // number of curves.
  int CurveAroundAt(int curve, double arc_mm) const {
    const WireState& state = session_.state();
    int around = scene_.stack().CurveAround(curve);
    while (around < state.curves() && arc_mm >= state.curve(around).insertion_mm()) {
      around = scene_.stack().CurveAround(around);
    }
    return around;
  }

  // `o`: another curve beside this one, or one whose lumen this one has left. A curve that touches
  // itself is both.
  double EnergyBeside(int c, int o) {
    constexpr std::size_t kApart = 4;  // segments of a curve that do not touch each other
    const Curve& curve = session_.state().curve(c);
    const Curve& other = session_.state().curve(o);
    bool has_left = c == o || scene_.stack().AreBeside(c, o);
    double energy_mJ = 0;
    double before_mm = 0;
    double arc_mm = 0;
    for (std::size_t i = 0; i < curve.nodes().size(); ++i) {
      const double length_mm = i == 0 ? 0 : (curve.nodes()[i] - curve.nodes()[i - 1]).norm();
      arc_mm += length_mm;
      const double last_mm = std::exchange(before_mm, 0);
      const Nearest nearest = NearestOn(other, curve.nodes()[i], c == o ? i + kApart : 0);
      const bool is_beyond = nearest.arc_mm >= other.insertion_mm() - 1e-6;  // the other tip
      has_left = has_left || is_beyond;
      if (!has_left || is_beyond || (c == o && nearest.is_begin)) continue;
      if (CurveAroundAt(c, arc_mm) != CurveAroundAt(o, nearest.arc_mm)) continue;
      const double touching_mm = SurfaceRadius(c, arc_mm) + SurfaceRadius(o, nearest.arc_mm);
      outcome_.closest = std::min(outcome_.closest, nearest.distance_mm / touching_mm);
      const double bulges_mm = i == 0 ? 0 : Bulges(c, i - 1, o, nearest.segment);
      before_mm = touching_mm - nearest.distance_mm - bulges_mm;
      energy_mJ += ContactEnergy(last_mm, before_mm, length_mm);
    }
    return energy_mJ;
  }

  double EnergyInLumen(int c, int o) {
    const Curve& curve = session_.state().curve(c);
    const Curve& outer = session_.state().curve(o);
    if (BendsSharply(scene_.stack().empty_rod(o), outer, LumenRadius(o, outer.insertion_mm()))) {
      bends_sharply_ = true;
      return 0;
    }
    double energy_mJ = 0;
    double before_mm = SurfaceRadius(c, 0) - LumenRadius(o, 0);
    double before_arc_mm = 0;
    double arc_mm = 0;
    for (std::size_t i = 1; i < curve.nodes().size(); ++i) {
      const double length_mm = (curve.nodes()[i] - curve.nodes()[i - 1]).norm();
      arc_mm += length_mm;
      const Nearest nearest = NearestOn(outer, curve.nodes()[i]);
      // Beyond the mouth, the curve may turn back along the outside.
      constexpr double kMouth_mm = 0.5;
      const bool is_back = nearest.arc_mm < before_arc_mm;
      if (is_back || nearest.arc_mm > outer.insertion_mm() - kMouth_mm) break;
      before_arc_mm = nearest.arc_mm;
      const double lumen_mm = LumenRadius(o, nearest.arc_mm);
      const double overlap_mm = nearest.distance_mm + SurfaceRadius(c, arc_mm) - lumen_mm;
      // The solver holds the arcs through the nodes apart, not the chords.
      if (overlap_mm - Bulges(c, i - 1, o, nearest.segment) > lumen_mm) {
        Object("curve ", c, " has broken through the lumen of curve ", o, " by ", overlap_mm,
               " mm at node ", i);
      }
      outcome_.overlap_mm = std::max(outcome_.overlap_mm, overlap_mm);
      const double bulges_mm = Bulges(c, i - 1, o, nearest.segment);
      energy_mJ += ContactEnergy(before_mm, overlap_mm - bulges_mm, length_mm);
      before_mm = overlap_mm - bulges_mm;
    }
    return energy_mJ;
  }

  void MakeTwin() {
    twin_scene_ = scene_.MakeTwin();
    twin_.emplace(*twin_scene_, session_);
    twin_ticks_ = 0;
  }

  void RepeatInTwin(int units) {
    CountedBudget budget(units);
    twin_->Tick(command_, budget);
    if (twin_->state_hash() != session_.state_hash()) {
      Object("a copy of the run gave another state in tick ", twin_ticks_ + 1);
    }
    if (++twin_ticks_ == kRepeated) twin_.reset();
  }

  // Makes single steps with the hands still.
  void Step() {
    constexpr int kSteps = 10;
    for (int k = 0; k < kSteps && IsWhole() && !session_.report().converged; ++k) {
      const double before = session_.report().relaxed_mJ();
      Tick(1);
      if (evolves_ || session_.report().actions != 0) continue;
      const double rise =
          (session_.report().relaxed_mJ() - before) / std::max(std::abs(before), 1e-6);
      outcome_.worst_rise = std::max(outcome_.worst_rise, rise);
      if (rise > kAllowedStackRise) {
        Object("a step took the energy from ", before, " to ", session_.report().relaxed_mJ(),
               " mJ");
      }
    }
  }

  void ComeToRest() {
    constexpr int kArrive = 400;
    constexpr int kSettle = 40;
    constexpr int kUnits = 400;
    for (int k = 0; k < kArrive && IsWhole() && !session_.report().arrived(); ++k) Tick(kUnits);
    if (!session_.report().arrived()) {
      Object("the instruments do not reach their commanded positions");
    }
    for (int k = 0; k < kSettle && IsWhole() && !outcome_.settled; ++k) {
      Step();
      Tick(kUnits);
      outcome_.settled = session_.at_rest();
    }
    if (!evolves_ && !outcome_.settled) {
      Object("the hands rest, but the instruments do not come to rest: residual ",
             outcome_.last_residual);
    }
  }

  void DrawOut() {
    for (int k = 0; k < command_.target.size(); ++k) command_.target[k] = {};
    constexpr int kTicks = 400;
    for (int k = 0; k < kTicks && IsWhole(); ++k) {
      Tick(400);
      if (session_.report().arrived()) return;
    }
    Object("the instruments cannot be drawn out");
  }

  void BeginAnew() {
    session_.Restart();
    for (std::size_t k = 0; k < hashes_.size() && IsWhole(); ++k) {
      CountedBudget budget(units_[k]);
      session_.Tick(commands_[k], budget);
      if (session_.state_hash() != hashes_[k]) {
        Object("begun again, tick ", k + 1, " gave another state than the first time");
      }
    }
  }

  scene::Scene& scene_;
  std::mt19937& random_;
  Simulation session_;
  const bool evolves_;
  std::unique_ptr<scene::Scene> twin_scene_;
  std::optional<Simulation> twin_;
  std::size_t twin_ticks_ = 0;
  Command command_;
  std::vector<Command> commands_;  // of the first ticks, to repeat them
  std::vector<int> units_;
  std::vector<std::uint64_t> hashes_;
  bool bends_sharply_ = false;  // a lumen has a bend of less than its diameter, in this state
  SceneOutcome outcome_;
};

}  // namespace

SceneOutcome RunScene(scene::Scene& scene, std::mt19937& random, int moves) {
  return SceneRun(scene, random).Run(moves);
}

}  // namespace torquer::study
