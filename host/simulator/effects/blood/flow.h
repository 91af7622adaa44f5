// Blood flow in the centerline network: one dimension, Poiseuille's resistance, and a pulse.
//
//   flow(t) = exchange between the pressures of the outlets          steady
//           + flow driven by the flow or the pressure at the inlet   times the pulse
//           + back pressure of the heart's muscle                    times the ejection
//
// A flow source at the inlet delivers its flow against any pressure. A pressure source delivers
// less if something else, such as an injection, adds to the flow.
//
// The model has no inertia of the blood and no compliance of the network's walls. So waves have no
// speed. With Windkessels, stenoses or obstructing devices the flow advances in short implicit
// steps. Without them the three parts are solved once.
#pragma once

#include <memory>
#include <optional>
#include <vector>

#include "host/simulator/effects/blood/flow_graph.h"
#include "host/simulator/effects/effect.h"

namespace torquer::effects {

/// Factor on the flow or the pressure of the inlet, over the heart's cycle: 1 - depth + depth *
/// ejection. The ejection is sin^2 in the first 35 % of the cycle; the factor has the mean 1. Never
/// negative.
struct Pulse {
  double per_minute = 0;  ///< 0: steady
  double depth = 0;       ///< 0 .. 1: fraction of the flow that comes only during the ejection
  double At(double time_s) const;
  /// The ejection, 0 .. 1; for a steady flow its mean over a cycle.
  double Ejection(double time_s) const;
};

/// Stenosis loss: the additional pressure loss at which the lumen widens behind a throat. It is
/// proportional to the square of the flow.
struct StenosisLoss {
  int edge = 0;
  double loss_mmHg_s2_mL2 = 0;
  double at_mm = 0;  ///< arc length of the throat on the edge's curve
};

/// A place on an edge of the graph, at which the pressure is wanted.
struct FlowPlace {
  int edge = 0;
  double s_mm = 0;              ///< arc length on the edge's curve
  double before_mmHg_s_mL = 0;  ///< Poiseuille's resistance from the edge's node a to the place
};

/// Pressure behind a device that closes the lumen: mmHg + ejection * muscle_mmHg.
struct ClosedPressure {
  double mmHg = 0;
  double muscle_mmHg = 0;  ///< of the heart's muscle, at the peak of the ejection
};

/// Obstruction of the flow: the instruments, in the middle of the lumen.
struct Obstruction {
  const WireModel* wire = nullptr;  ///< an empty rod; null: no obstruction
  const vessel::MovingField* moving = nullptr;
};

/// A further end through which the blood enters, with a mean flow against any pressure.
struct FlowSource {
  int node = 0;
  double mL_s = 0;
};

/// The end through which the blood enters, at a node of the graph.
struct FlowInlet {
  int node = 0;
  double mL_s = 0;  ///< mean of a flow source; unused if a pressure is given
  /// Flow source with that mean pressure, which sets its mean flow.
  std::optional<double> mean_mmHg = std::nullopt;
  /// Pressure source with that mean pressure, behind a resistance; 0: at the inlet itself.
  std::optional<double> held_mmHg = std::nullopt;
  double resistance_mmHg_s_mL = 0;
  /// Other inlets. A part of the network that is not connected to `node` needs at least one.
  std::vector<FlowSource> others = {};
};

class Flow final : public Effect, public Evolution {
 public:
  /// outlets: all free ends but the inlets. At most one of the inlet's pressures is given.
  /// viscosity_Pa_s > 0. The objects that `obstruction` points to must outlive this.
  Flow(std::unique_ptr<const FlowGraph> graph, double viscosity_Pa_s, const FlowInlet& inlet,
       std::vector<FlowEnd> outlets, const Pulse& pulse, std::vector<StenosisLoss> stenoses = {},
       const Obstruction& obstruction = {});

  Evolution* evolution() override { return this; }
  void Advance(const TickView& tick) override;
  void Restart() override;
  void CopyFrom(const Effect& twin) override;

  /// Advances Windkessels and stenoses to a time.
  void AdvanceTo(double time_s);
  /// Sets the present position of the devices.
  void Obstruct(const WireState& state, const QuadraticModel& quadratic);
  /// Pressures need the place that PlaceOn found.
  FlowPlace PlaceOn(const vessel::CenterlinePlace& place) const;
  /// Pressure at a place and a time, mmHg. Valid for the times of EdgesAt.
  double PressureAt(const FlowPlace& place, double time_s) const;
  /// Pressure on the downstream side of a place if a device closes the lumen there. The side is
  /// that of the mean flow. Other ways to it (collaterals) stay open, at their mean flow.
  ClosedPressure PressureBehind(const FlowPlace& place) const;

  const FlowGraph& graph() const { return *graph_; }
  /// Steady network: its response to additional inflow.
  const FlowSolution& solution() const { return *steady_; }
  /// Grows with each change of solution().
  int version() const { return memory_.version; }
  /// Mean over a cycle; stenosis losses are taken at the mean flow.
  const FlowSolution::Flows& mean() const { return memory_.mean; }
  const Pulse& pulse() const { return pulse_; }
  int inlet() const { return inlet_.node; }
  /// Flow of every edge, mL/s, at a time. Any time is allowed without Windkessels, stenoses and
  /// obstruction; otherwise only times of the last advance.
  void EdgesAt(double time_s, std::vector<double>& edge_mL_s) const;
  /// Pressures and flows of the last step; the mean if the flow is not stepped.
  const FlowSolution::Flows& now() const { return memory_.now; }

 private:
  struct Snapshot {
    double time_s = 0;
    std::vector<double> edge_mL_s;
    std::vector<double> pressure_mmHg;  // of each node
  };
  // Resistance that a stretch of a device adds to an edge.
  struct Narrowing {
    int edge = 0;
    double s_mm = 0;
    double mmHg_s_mL = 0;
  };
  // State of the flow, without the solutions, which belong to one graph.
  struct Memory {
    std::vector<FlowEnd> ends;          // the outlets, then the inlet if it holds its pressure
    double inlet_mL_s = 0;              // mean of a flow source
    std::vector<double> obstructed;     // increase of poiseuille_ by devices
    std::vector<Narrowing> narrowings;  // where it lies
    int version = 0;
    FlowSolution::Flows mean, exchange, driven, muscle;
    std::vector<double> step_losses_mL_s;  // flow through each stenosis for which step_ was made
    std::vector<double> stored_mmHg;       // at each Windkessel's compliance
    FlowSolution::Flows now;               // of the last step
    double time_s = 0;
    std::vector<Snapshot> snapshots;  // of the last advance
    std::size_t snapshot_count = 0;
    double obstruction_age_s = 0;
  };

  std::vector<double> Resistances(const std::vector<double>& stenosis_flow_mL_s) const;
  // Inflow into each node: that of the inlet, and those of the others times a factor.
  std::vector<double> Inflow(double inlet_mL_s, double others) const;
  bool IsHeldInlet(const FlowEnd& end) const { return end.node == inlet_.node; }
  const Snapshot* SnapshotAt(double time_s) const;
  double ResistanceBefore(const FlowPlace& place, double edge_mL_s) const;
  void AddNarrowings(const Curve& curve, const PointSet& points,
                     std::vector<Narrowing>& narrowings) const;
  void SolveMean();
  void MakeStep();
  void Step();

  std::unique_ptr<const FlowGraph> graph_;
  const Pulse pulse_;
  const FlowInlet inlet_;
  const std::vector<StenosisLoss> stenoses_;
  const Obstruction obstruction_;
  const double mmHg_s_per_mL_mm3_;  // Poiseuille, for an integral of 1/r^4
  bool has_windkessel_ = false;
  bool stepped_ = false;
  std::vector<double> poiseuille_;  // of each edge, mmHg s/mL
  std::unique_ptr<FlowSolution> steady_;
  std::unique_ptr<FlowSolution> step_;
  Memory memory_;
};

/// Poiseuille: 8 mu / pi times the integral of 1/r^4.
double PoiseuilleMmHgSPerML(double viscosity_Pa_s, double inverse_fourth_power_1_mm3);

/// Replaces 1/r^4 in Poiseuille's law for a tube of radius `tube_mm` with a concentric cylinder of
/// radius `core_mm` < tube_mm. Closed form for an annulus.
double AnnulusInverseFourthPower(double tube_mm, double core_mm);

/// Loss behind a throat, Kt rho/2 (A/throat - 1)^2 (Q/A)^2 with Kt = 1.52: Young and Tsai, J
/// Biomech 1973;6:395-410. Areas in mm^2, result in mmHg for (mL/s)^2.
double StenosisLossMmHg(double area_mm2, double throat_mm2);

EffectKind FlowKind();

}  // namespace torquer::effects
