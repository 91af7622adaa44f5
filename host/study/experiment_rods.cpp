#include "host/study/experiment_rods.h"

#include <cmath>
#include <stdexcept>

#include "host/simulator/core/newton/newton_relaxation.h"
#include "host/simulator/effects/loads/gravity.h"
#include "host/simulator/effects/loads/point_load.h"
#include "host/study/cases/analytic_fields.h"
#include "host/study/cases/simple_wire.h"

namespace torquer::study {
namespace {

using effects::EndLoad;
using effects::Gravity;
using effects::PointLoad;
using Eigen::Vector3d;

// Rod along x, loaded along y.
class LoadedRod {
 public:
  LoadedRod(double length_mm, double rigidity_N_mm2, double weight_N_mm, double segment_mm)
      : length_mm_(length_mm),
        model_(MakeWire({.segment_mm = segment_mm,
                         .rigidity_N_mm2 = rigidity_N_mm2,
                         .max_length_mm = length_mm})),
        gravity_({Vector3d(0, weight_N_mm, 0)}),
        end_({}),
        relaxation_(model_, field_, wall_, {.tolerance = 1e-8}, terms_),
        state_(WireState::Along(model_, {}, {length_mm, 0})) {
    relaxation_.Restart(state_);
  }

  void Rest(const EndLoad& load) {
    end_.SetLoad(load);
    for (int tick = 0; tick < 20; ++tick) {
      CountedBudget budget(2000);
      if (relaxation_.Tick({length_mm_, 0}, budget, state_).converged) return;
    }
    throw std::runtime_error("a rod of " + std::to_string(length_mm_) + " mm did not come to rest");
  }

  const WireState& state() const { return state_; }

 private:
  double length_mm_;
  WireModel model_;
  FreeSpace field_;
  WallModel wall_;
  Gravity gravity_;
  PointLoad end_;
  std::vector<EnergyTerm*> terms_{&gravity_, &end_};
  NewtonRelaxation relaxation_;
  WireState state_;
};

// Axial force of a rod between two clamps that are closer together than its length.
struct Pressed {
  double shortening_mm;
  double force_N;
};

Pressed Press(LoadedRod& rod, EndLoad& clamp, double length_mm, double shortening_mm) {
  clamp.place_mm = Vector3d(length_mm - shortening_mm, 0, 0);
  rod.Rest(clamp);
  const double end_mm = rod.state().tip()[0];
  return {length_mm - end_mm, clamp.hold_N_mm * (end_mm - clamp.place_mm[0])};
}

}  // namespace

double BentRod::CurvatureAt(double from_clamp_mm) const {
  return curvatures_1_per_mm.at(static_cast<std::size_t>(std::lround(from_clamp_mm / segment_mm)));
}

BentRod Bend(const ClampedRod& rod, double segment_mm) {
  LoadedRod loaded(rod.length_mm, rod.rigidity_N_mm2, rod.weight_N_mm, segment_mm);
  EndLoad load;
  load.force_N = Vector3d(0, rod.end_force_N, 0);
  loaded.Rest(load);
  BentRod bent;
  bent.segment_mm = segment_mm;
  bent.deflection_mm = loaded.state().tip()[1];
  Vector3d before = Vector3d::UnitX();
  for (const Vector3d& tangent : loaded.state().tangents()) {
    const double angle = 2 * std::asin((tangent - before).norm() / 2);
    bent.curvatures_1_per_mm.push_back(angle / segment_mm);
    before = tangent;
  }
  bent.curvatures_1_per_mm.push_back(0);  // at the free end
  return bent;
}

EvenLoad BendTo(ClampedRod rod, double curvature_1_per_mm, double from_clamp_mm,
                double segment_mm) {
  const double beyond_mm = rod.length_mm - from_clamp_mm;
  rod.weight_N_mm = 2 * rod.rigidity_N_mm2 * curvature_1_per_mm / (beyond_mm * beyond_mm);
  for (int k = 0; k < 4; ++k) {  // nearly linear: each iteration reduces the error to a hundredth
    rod.weight_N_mm *= curvature_1_per_mm / Bend(rod, segment_mm).CurvatureAt(from_clamp_mm);
  }
  return {rod.weight_N_mm, Bend(rod, segment_mm)};
}

double BucklingForce(double length_mm, double rigidity_N_mm2, int segments) {
  // The far clamp holds the whole last segment: the rod is free to bend up to its middle.
  const double segment_mm = length_mm / (segments - 0.5);
  const double cut_mm = segments * segment_mm;
  const double unit_N = rigidity_N_mm2 / (length_mm * length_mm);
  // This tiny weight only selects the side to which the rod buckles.
  LoadedRod rod(cut_mm, rigidity_N_mm2, 1e-6 * unit_N / length_mm, segment_mm);
  EndLoad clamp;
  clamp.hold_N_mm = 1e5 * unit_N / length_mm;
  clamp.align_mJ = 1e4 * rigidity_N_mm2 / length_mm;
  clamp.direction = Vector3d::UnitX();
  const Pressed more = Press(rod, clamp, cut_mm, 4e-3 * length_mm);
  const Pressed less = Press(rod, clamp, cut_mm, 2e-3 * length_mm);
  const double slope = (more.force_N - less.force_N) / (more.shortening_mm - less.shortening_mm);
  return less.force_N - slope * less.shortening_mm;
}

}  // namespace torquer::study
