#include "host/simulator/effects/blood/flow.h"

#include <algorithm>
#include <cmath>
#include <numbers>

#include "host/support/error.h"

namespace torquer::effects {

namespace {

constexpr double kEjection = 0.35;        // fraction of a cycle
constexpr double kStepS = 2e-3;           // resolves the ejection, and a Windkessel to 0.1 %
constexpr double kObstructionS = 0.05;    // interval between searches for devices
constexpr double kObstructionStepMm = 2;  // step along the devices
constexpr double kMostFilled = 0.98;      // of the radius; keeps the lumen open
constexpr double kPaPerMmHg = 133.322387415;

}  // namespace

double PoiseuilleMmHgSPerML(double viscosity_Pa_s, double inverse_fourth_power_1_mm3) {
  constexpr double kMm3PerML = 1e3;
  return 8 * viscosity_Pa_s / std::numbers::pi * inverse_fourth_power_1_mm3 * kMm3PerML /
         kPaPerMmHg;
}

double AnnulusInverseFourthPower(double tube_mm, double core_mm) {
  const double r2 = tube_mm * tube_mm;
  const double a2 = core_mm * core_mm;
  if (a2 <= 0) return 1 / (r2 * r2);
  return 1 / (r2 * r2 - a2 * a2 - (r2 - a2) * (r2 - a2) / std::log(tube_mm / core_mm));
}

double StenosisLossMmHg(double area_mm2, double throat_mm2) {
  constexpr double kTurbulence = 1.52;
  constexpr double kBloodKgPerM3 = 1060;
  const double widening = area_mm2 / throat_mm2 - 1;
  // 1 mL/s through 1 mm^2 is 1 m/s.
  return kTurbulence * kBloodKgPerM3 / 2 * widening * widening / (area_mm2 * area_mm2) / kPaPerMmHg;
}

double Pulse::Ejection(double time_s) const {
  if (per_minute <= 0) return kEjection / 2;
  const double cycles = time_s * per_minute / 60;
  const double phase = cycles - std::floor(cycles);
  const double wave = phase < kEjection ? std::sin(std::numbers::pi * phase / kEjection) : 0;
  return wave * wave;
}

double Pulse::At(double time_s) const {
  if (per_minute <= 0) return 1;
  return 1 - depth + depth * Ejection(time_s) * 2 / kEjection;
}

Flow::Flow(std::unique_ptr<const FlowGraph> graph, double viscosity_Pa_s, const FlowInlet& inlet,
           std::vector<FlowEnd> outlets, const Pulse& pulse, std::vector<StenosisLoss> stenoses,
           const Obstruction& obstruction)
    : graph_(std::move(graph)),
      pulse_(pulse),
      inlet_(inlet),
      stenoses_(std::move(stenoses)),
      obstruction_(obstruction),
      mmHg_s_per_mL_mm3_(PoiseuilleMmHgSPerML(viscosity_Pa_s, 1)) {
  memory_.ends = std::move(outlets);
  for (const FlowEnd& end : memory_.ends) {
    has_windkessel_ = has_windkessel_ || end.compliance_mL_mmHg > 0;
  }
  if (inlet_.held_mmHg) {
    memory_.ends.push_back({.node = inlet_.node,
                            .is_pressure = inlet_.resistance_mmHg_s_mL == 0,
                            .pressure_mmHg = *inlet_.held_mmHg,
                            .resistance_mmHg_s_mL = inlet_.resistance_mmHg_s_mL});
  } else {
    memory_.inlet_mL_s = inlet_.mL_s;
  }
  for (const FlowEdge& edge : graph_->edges()) {
    poiseuille_.push_back(PoiseuilleMmHgSPerML(
        viscosity_Pa_s, graph_->InverseFourthPower(edge.curve, edge.from_mm, edge.to_mm)));
  }
  stepped_ = has_windkessel_ || !stenoses_.empty() || obstruction_.wire != nullptr;
  Restart();
}

void Flow::Restart() {
  memory_.time_s = 0;
  memory_.obstruction_age_s = kObstructionS;
  memory_.obstructed.assign(poiseuille_.size(), 0);
  memory_.narrowings.clear();
  SolveMean();
  memory_.now = memory_.mean;
  memory_.snapshot_count = 0;
  if (!stepped_) return;
  // The initial stored pressures are those of the mean flow.
  memory_.stored_mmHg.assign(memory_.ends.size(), 0);
  for (std::size_t k = 0; k < memory_.ends.size(); ++k) {
    memory_.stored_mmHg[k] =
        memory_.now.pressure_mmHg[static_cast<std::size_t>(memory_.ends[k].node)] -
        memory_.ends[k].proximal_mmHg_s_mL * memory_.now.end_mL_s[k];
  }
  memory_.step_losses_mL_s.clear();
  for (const StenosisLoss& loss : stenoses_) {
    memory_.step_losses_mL_s.push_back(
        std::abs(memory_.now.edge_mL_s[static_cast<std::size_t>(loss.edge)]));
  }
  MakeStep();
}

void Flow::CopyFrom(const Effect& twin) {
  const auto& from = dynamic_cast<const Flow&>(twin);
  memory_ = from.memory_;
  steady_ = std::make_unique<FlowSolution>(*from.steady_, *graph_);
  if (stepped_) step_ = std::make_unique<FlowSolution>(*from.step_, *graph_);
}

std::vector<double> Flow::Inflow(double inlet_mL_s, double others) const {
  std::vector<double> inflow(graph_->nodes().size(), 0);
  inflow[static_cast<std::size_t>(inlet_.node)] = inlet_mL_s;
  for (const FlowSource& other : inlet_.others) {
    inflow[static_cast<std::size_t>(other.node)] = others * other.mL_s;
  }
  return inflow;
}

std::vector<double> Flow::Resistances(const std::vector<double>& stenosis_flow_mL_s) const {
  std::vector<double> all = poiseuille_;
  for (std::size_t e = 0; e < all.size(); ++e) all[e] += memory_.obstructed[e];
  for (std::size_t k = 0; k < stenoses_.size(); ++k) {
    all[static_cast<std::size_t>(stenoses_[k].edge)] +=
        stenoses_[k].loss_mmHg_s2_mL2 * stenosis_flow_mL_s[k];
  }
  return all;
}

namespace {

// Moves the linearization flows of the losses halfway to the computed flows, which converges for
// any loss. Returns false once they agree.
bool MoveLosses(const std::vector<StenosisLoss>& stenoses, const FlowSolution::Flows& flows,
                std::vector<double>& flow_mL_s) {
  constexpr double kAgreed = 1e-7;
  bool moved = false;
  for (std::size_t k = 0; k < stenoses.size(); ++k) {
    const double now = std::abs(flows.edge_mL_s[static_cast<std::size_t>(stenoses[k].edge)]);
    if (std::abs(now - flow_mL_s[k]) <= kAgreed * (1 + now)) continue;
    flow_mL_s[k] = (flow_mL_s[k] + now) / 2;
    moved = true;
  }
  return moved;
}

constexpr int kMostRounds = 60;

}  // namespace

void Flow::SolveMean() {
  std::vector<double> losses_mL_s(stenoses_.size(), 0);
  const std::vector<double> none(memory_.ends.size(), 0);
  std::vector<double> outlet_mmHg = none;
  std::vector<double> inlet_mmHg = none;
  std::vector<double> systolic_mmHg = none;
  for (std::size_t k = 0; k < memory_.ends.size(); ++k) {
    const FlowEnd& end = memory_.ends[k];
    (IsHeldInlet(end) ? inlet_mmHg : outlet_mmHg)[k] = end.pressure_mmHg;
    systolic_mmHg[k] = end.systolic_mmHg;
  }
  const double ejection = Pulse().Ejection(0);
  for (int round = 0; round < kMostRounds; ++round) {
    const std::vector<double> resistances = Resistances(losses_mL_s);
    steady_ = std::make_unique<FlowSolution>(*graph_, resistances, memory_.ends);
    memory_.exchange = steady_->Solve(Inflow(0, 0), outlet_mmHg);
    memory_.muscle = steady_->Solve(Inflow(0, 0), systolic_mmHg);
    if (inlet_.mean_mmHg) {
      // Sets the inlet's mean flow to match its pressure, which is linear in the flow.
      const auto at = static_cast<std::size_t>(inlet_.node);
      const double unit_mmHg = steady_->Solve(Inflow(1, 0), none).pressure_mmHg[at];
      const double others_mmHg = steady_->Solve(Inflow(0, 1), none).pressure_mmHg[at];
      memory_.inlet_mL_s = (*inlet_.mean_mmHg - memory_.exchange.pressure_mmHg[at] -
                            ejection * memory_.muscle.pressure_mmHg[at] - others_mmHg) /
                           unit_mmHg;
    }
    memory_.driven = steady_->Solve(Inflow(memory_.inlet_mL_s, 1), inlet_mmHg);
    memory_.mean = memory_.exchange;
    const auto add = [&](std::vector<double> FlowSolution::Flows::*part) {
      for (std::size_t i = 0; i < (memory_.mean.*part).size(); ++i) {
        (memory_.mean.*part)[i] += (memory_.driven.*part)[i] + ejection * (memory_.muscle.*part)[i];
      }
    };
    add(&FlowSolution::Flows::edge_mL_s);
    add(&FlowSolution::Flows::pressure_mmHg);
    add(&FlowSolution::Flows::end_mL_s);
    if (!MoveLosses(stenoses_, memory_.mean, losses_mL_s)) break;
  }
  ++memory_.version;
}

// An implicit step of a Windkessel is a resistance with a pressure behind it:
//   C (p - p_before)/h = q - (p - behind)/R,   end = p + proximal q.
void Flow::MakeStep() {
  std::vector<FlowEnd> ends = memory_.ends;
  for (FlowEnd& end : ends) {
    if (end.compliance_mL_mmHg == 0) continue;
    end.resistance_mmHg_s_mL = 1 / (end.compliance_mL_mmHg / kStepS + 1 / end.resistance_mmHg_s_mL);
  }
  step_ = std::make_unique<FlowSolution>(*graph_, Resistances(memory_.step_losses_mL_s),
                                         std::move(ends));
}

void Flow::Step() {
  memory_.time_s += kStepS;
  const double factor = pulse_.At(memory_.time_s);
  const std::vector<double> inflow = Inflow(memory_.inlet_mL_s * factor, factor);
  const double ejection = pulse_.Ejection(memory_.time_s);
  std::vector<double> behind(memory_.ends.size(), 0);
  for (std::size_t k = 0; k < memory_.ends.size(); ++k) {
    const FlowEnd& end = memory_.ends[k];
    const double pulse = IsHeldInlet(end) ? factor : 1;
    behind[k] = pulse * end.pressure_mmHg + ejection * end.systolic_mmHg;
    if (end.compliance_mL_mmHg == 0) continue;
    behind[k] = (end.compliance_mL_mmHg / kStepS * memory_.stored_mmHg[k] +
                 behind[k] / end.resistance_mmHg_s_mL) *
                step_->ends()[k].resistance_mmHg_s_mL;
  }
  for (int round = 0; round < kMostRounds; ++round) {
    memory_.now = step_->Solve(inflow, behind);
    if (!MoveLosses(stenoses_, memory_.now, memory_.step_losses_mL_s)) break;
    MakeStep();
  }
  for (std::size_t k = 0; k < memory_.ends.size(); ++k) {
    if (memory_.ends[k].compliance_mL_mmHg == 0) continue;
    memory_.stored_mmHg[k] =
        behind[k] + step_->ends()[k].resistance_mmHg_s_mL * memory_.now.end_mL_s[k];
  }
}

void Flow::AdvanceTo(double time_s) {
  if (!stepped_) return;
  constexpr double kEarlyS = 1e-9;
  memory_.snapshot_count = 0;
  while (memory_.time_s + kStepS <= time_s + kEarlyS) {
    Step();
    if (memory_.snapshots.size() == memory_.snapshot_count) memory_.snapshots.emplace_back();
    Snapshot& taken = memory_.snapshots[memory_.snapshot_count++];
    taken.time_s = memory_.time_s;
    taken.edge_mL_s = memory_.now.edge_mL_s;
    taken.pressure_mmHg = memory_.now.pressure_mmHg;
  }
}

void Flow::Advance(const TickView& tick) {
  if (obstruction_.wire != nullptr) {
    memory_.obstruction_age_s += tick.step_s;
    if (memory_.obstruction_age_s >= kObstructionS) {
      memory_.obstruction_age_s = 0;
      Obstruct(tick.state, tick.quadratic);
    }
  }
  AdvanceTo(tick.time_s);
}

void Flow::Obstruct(const WireState& state, const QuadraticModel& quadratic) {
  memory_.narrowings.clear();
  for (int c = 0; c < state.curves(); ++c) {
    AddNarrowings(state.curve(c), quadratic.curve(c).points, memory_.narrowings);
  }
  std::vector<double> more(memory_.obstructed.size(), 0);
  for (const Narrowing& one : memory_.narrowings) {
    more[static_cast<std::size_t>(one.edge)] += one.mmHg_s_mL;
  }
  constexpr double kNoticed = 1e-3;
  bool same = true;
  for (std::size_t e = 0; e < more.size(); ++e) {
    same =
        same && std::abs(more[e] - memory_.obstructed[e]) <= kNoticed * (poiseuille_[e] + more[e]);
  }
  if (same) return;
  memory_.obstructed = std::move(more);
  SolveMean();
  MakeStep();
}

// Adds the resistance that a curve makes outside the lumens of others.
void Flow::AddNarrowings(const Curve& curve, const PointSet& points,
                         std::vector<Narrowing>& narrowings) const {
  const WireModel& wire = *obstruction_.wire;
  const vessel::CenterlineNetwork& network = graph_->network();
  const int n = curve.segments();
  const int stride = std::max(1, static_cast<int>(kObstructionStepMm / wire.segment_mm()));
  for (int i = points.among.in_lumen / points.per_segment; i < n; i += stride) {
    const int last = std::min(n, i + stride);
    double length_mm = 0;
    for (int k = i; k < last; ++k) length_mm += curve.SegmentLength(wire, k);
    const auto a = static_cast<std::size_t>(i);
    const auto b = static_cast<std::size_t>(last);
    Eigen::Vector3d middle = (curve.nodes()[a] + curve.nodes()[b]) / 2;
    if (obstruction_.moving != nullptr) middle = obstruction_.moving->AtRest(middle);
    double distance_mm = 0;
    const vessel::CenterlinePlace place = network.NearestTo(middle, &distance_mm);
    const double tube_mm = network.At(place).radius_mm;
    if (distance_mm > tube_mm) continue;
    const double core_mm = std::min(
        kMostFilled * tube_mm,
        points
            .radius_mm[static_cast<std::size_t>(i) * static_cast<std::size_t>(points.per_segment)]);
    narrowings.push_back({.edge = graph_->EdgeAt(place),
                          .s_mm = place.s_mm,
                          .mmHg_s_mL = mmHg_s_per_mL_mm3_ * length_mm *
                                       (AnnulusInverseFourthPower(tube_mm, core_mm) -
                                        AnnulusInverseFourthPower(tube_mm, 0))});
  }
}

// The first snapshot at or after a time; null if the last step is the one.
const Flow::Snapshot* Flow::SnapshotAt(double time_s) const {
  const auto begin = memory_.snapshots.begin();
  const auto end = begin + static_cast<std::ptrdiff_t>(memory_.snapshot_count);
  const auto found = std::lower_bound(
      begin, end, time_s, [](const Snapshot& one, double at_s) { return one.time_s < at_s; });
  return found == end ? nullptr : &*found;
}

void Flow::EdgesAt(double time_s, std::vector<double>& edge_mL_s) const {
  if (stepped_) {
    const Snapshot* const then = SnapshotAt(time_s);
    edge_mL_s = then == nullptr ? memory_.now.edge_mL_s : then->edge_mL_s;
    return;
  }
  const double factor = pulse_.At(time_s);
  const double ejection = pulse_.Ejection(time_s);
  edge_mL_s.resize(memory_.mean.edge_mL_s.size());
  for (std::size_t e = 0; e < edge_mL_s.size(); ++e) {
    edge_mL_s[e] = memory_.exchange.edge_mL_s[e] + factor * memory_.driven.edge_mL_s[e] +
                   ejection * memory_.muscle.edge_mL_s[e];
  }
}

FlowPlace Flow::PlaceOn(const vessel::CenterlinePlace& place) const {
  FlowPlace on{.edge = graph_->EdgeAt(place)};
  const FlowEdge& edge = graph_->edges()[static_cast<std::size_t>(on.edge)];
  on.s_mm = std::clamp(place.s_mm, edge.from_mm, edge.to_mm);
  on.before_mmHg_s_mL =
      mmHg_s_per_mL_mm3_ * graph_->InverseFourthPower(edge.curve, edge.from_mm, on.s_mm);
  return on;
}

// Resistance from the edge's node a to a place: Poiseuille, devices and stenoses.
double Flow::ResistanceBefore(const FlowPlace& place, double edge_mL_s) const {
  double sum = place.before_mmHg_s_mL;
  for (const Narrowing& one : memory_.narrowings) {
    if (one.edge == place.edge && one.s_mm < place.s_mm) sum += one.mmHg_s_mL;
  }
  for (const StenosisLoss& loss : stenoses_) {
    if (loss.edge != place.edge || loss.at_mm >= place.s_mm) continue;
    sum += loss.loss_mmHg_s2_mL2 * std::abs(edge_mL_s);
  }
  return sum;
}

double Flow::PressureAt(const FlowPlace& place, double time_s) const {
  const auto e = static_cast<std::size_t>(place.edge);
  const auto a = static_cast<std::size_t>(graph_->edges()[e].a);
  double node_mmHg = 0;
  double edge_mL_s = 0;
  if (stepped_) {
    const Snapshot* const then = SnapshotAt(time_s);
    node_mmHg = then == nullptr ? memory_.now.pressure_mmHg[a] : then->pressure_mmHg[a];
    edge_mL_s = then == nullptr ? memory_.now.edge_mL_s[e] : then->edge_mL_s[e];
  } else {
    const auto at = [&](const std::vector<double>& exchange, const std::vector<double>& driven,
                        const std::vector<double>& muscle, std::size_t i) {
      return exchange[i] + pulse_.At(time_s) * driven[i] + pulse_.Ejection(time_s) * muscle[i];
    };
    node_mmHg = at(memory_.exchange.pressure_mmHg, memory_.driven.pressure_mmHg,
                   memory_.muscle.pressure_mmHg, a);
    edge_mL_s =
        at(memory_.exchange.edge_mL_s, memory_.driven.edge_mL_s, memory_.muscle.edge_mL_s, e);
  }
  return node_mmHg - edge_mL_s * ResistanceBefore(place, edge_mL_s);
}

ClosedPressure Flow::PressureBehind(const FlowPlace& place) const {
  constexpr double kClosed = 1e9;  // factor on the resistance of the closed edge
  const auto e = static_cast<std::size_t>(place.edge);
  const FlowEdge& edge = graph_->edges()[e];
  const int behind = memory_.mean.edge_mL_s[e] < 0 ? edge.a : edge.b;
  std::vector<double> resistances = steady_->resistance_mmHg_s_mL();
  resistances[e] *= kClosed;
  const FlowSolution closed(*graph_, std::move(resistances), memory_.ends);
  std::vector<double> ends_mmHg;
  std::vector<double> systolic_mmHg;
  for (const FlowEnd& end : memory_.ends) {
    ends_mmHg.push_back(end.pressure_mmHg);
    systolic_mmHg.push_back(end.systolic_mmHg);
  }
  // A flow source before the closed place delivers nothing: its pressure would have no limit.
  const std::vector<bool> reached = graph_->ReachedFrom(behind, place.edge);
  std::vector<double> inflow = Inflow(memory_.inlet_mL_s, 1);
  for (std::size_t n = 0; n < inflow.size(); ++n) {
    if (!reached[n]) inflow[n] = 0;
  }
  const auto at = static_cast<std::size_t>(behind);
  return {.mmHg = closed.Solve(inflow, ends_mmHg).pressure_mmHg[at],
          .muscle_mmHg = closed.Solve(Inflow(0, 0), systolic_mmHg).pressure_mmHg[at]};
}

}  // namespace torquer::effects
