// The paper's wire in our T-Y phantom: what the paper study measures with.
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

/// The angle of the paper's curved tip.
inline constexpr double kPaperTipRad = std::numbers::pi / 4;

/// One GR cycle and the PR cycle before it.
struct PaperCycle {
  double physical_s = 0;
  double geometrical_s = 0;
  GeometricalInterval interval;  ///< of length 0 where none was found
  double energy_mJ = 0;          ///< after both
  double residual = 0;
};

/// A wire of 250 mm, its last 5 mm the tip; the rest as set up.
class PaperBench {
 public:
  struct Setup {
    double segment_mm = 1;
    double tip_angle_rad = 0;  ///< over the tip's 5 mm
    BendingLaw law = BendingLaw::kG1;
    PhysicalSettings physical = {};
    double rigidity_N_mm2 = 6.35e-3;
    double radius_mm = 0.178;
    double wall_N_mm2 = 0.01;
  };
  static constexpr double kLengthMm = 250;

  PaperBench(const vessel::TubeVessel& phantom, const Setup& setup);

  int full_segments() const;  ///< n of the whole wire
  const WireModel& model() const { return model_; }
  const WireState& state() const { return state_; }
  /// Takes over the shape of a wire of the same length and segments.
  void SetShape(const WireState& other);

  /// Fast insertion of the whole wire, Tip Relaxations only. Seconds.
  double InsertFast();
  /// The largest penetration during it so far, mm.
  double deepest_mm() const { return deepest_mm_; }

  /// One PR cycle, and a GR cycle after it where asked for.
  PaperCycle Cycle(bool with_geometrical);

  /// Contact share of every node (0 .. n) and mean |du| of every segment over PR cycles, looked at
  /// after every iteration of a cycle.
  struct Bouncing {
    std::vector<double> contact_share;
    std::vector<double> mean_update;
  };
  Bouncing Observe(int cycles);

  /// The equilibrium near the present shape, by Newton's method; `converged` may be null.
  WireState Equilibrium(bool* converged);

  /// Energy and residual now.
  const Expansion& Assess();
  std::int64_t lookups() const { return physical_.lookups(); }

 private:
  const vessel::TubeVessel& phantom_;
  WireModel model_;
  WallModel wall_;
  PhysicalSettings settings_;
  const std::vector<EnergyTerm*> no_terms_;
  WireMechanics mechanics_;
  Expansion expansion_;
  PhysicalRelaxation physical_;
  GeometricalRelaxation geometrical_;
  WireState state_;
  double deepest_mm_ = 0;
};

/// Mean distance of the nodes of two wires of equally many segments, mm.
double MeanDistance(const WireState& a, const WireState& b);

}  // namespace torquer::study
