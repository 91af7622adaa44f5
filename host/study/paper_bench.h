// Paper bench: the paper's wire in our T-Y phantom, for the paper study.
#pragma once

#include <cstdint>
#include <memory>
#include <numbers>
#include <vector>

#include "host/simulator/core/newton/newton_relaxation.h"
#include "host/simulator/core/paper/geometrical_relaxation.h"
#include "host/simulator/core/paper/paper_relaxation.h"
#include "host/simulator/vessel/phantoms.h"

namespace torquer::study {

/// Angle of the paper's curved tip.
inline constexpr double kPaperTipRad = std::numbers::pi / 4;

/// One GR cycle and the PR cycle before it.
struct PaperCycle {
  double physical_s = 0;
  double geometrical_s = 0;
  GeometricalInterval interval;  ///< length 0 if none was found
  double energy_mJ = 0;          ///< energy after both cycles
  double residual = 0;
};

/// Wire of 250 mm with a tip of 5 mm; Setup gives all other parameters.
class PaperBench {
 public:
  struct Setup {
    double segment_mm = 1;
    double tip_angle_rad = 0;  ///< bending angle over the tip's 5 mm
    BendingLaw law = BendingLaw::kG1;
    PhysicalSettings physical = {};
    double rigidity_N_mm2 = 6.35e-3;
    double radius_mm = 0.178;
    double wall_N_mm2 = 0.01;
  };
  static constexpr double kLengthMm = 250;

  PaperBench(const vessel::TubeVessel& phantom, const Setup& setup);

  int full_segments() const;  ///< number of segments n of the whole wire
  const WireModel& model() const { return model_; }
  const WireState& state() const { return state_; }
  /// Copies the shape of a wire of the same length and number of segments.
  void SetShape(const WireState& other);

  /// Inserts the whole wire fast, with Tip Relaxations only. Returns the time taken, s.
  double InsertFast();
  /// Largest penetration during InsertFast() so far, mm.
  double deepest_mm() const { return deepest_mm_; }

  /// Runs one PR cycle, followed by a GR cycle if `with_geometrical` is set.
  PaperCycle Cycle(bool with_geometrical);

  /// Contact share of every node (0 .. n) and mean |du| of every segment over PR cycles. They are
  /// sampled after every iteration of a cycle.
  struct Bouncing {
    std::vector<double> contact_share;
    std::vector<double> mean_update;
  };
  Bouncing Observe(int cycles);

  /// Equilibrium near the present shape, by Newton's method; `converged` may be null.
  WireState Equilibrium(bool* converged);

  /// Energy and residual of the present shape.
  const QuadraticModel& Assess();
  std::int64_t lookups() const { return physical_.lookups(); }

 private:
  const vessel::TubeVessel& phantom_;
  WireModel model_;
  WallModel wall_;
  PhysicalSettings settings_;
  const std::vector<EnergyTerm*> no_terms_;
  WireMechanics mechanics_;
  QuadraticModel quadratic_;
  PhysicalRelaxation physical_;
  GeometricalRelaxation geometrical_;
  WireState state_;
  double deepest_mm_ = 0;
};

/// Mean distance of the nodes of two wires of equally many segments, mm.
double MeanDistance(const WireState& a, const WireState& b);

}  // namespace torquer::study
