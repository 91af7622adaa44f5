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

Flow::Flow(std::unique_ptr<const FlowGraph> graph, double viscosity_Pa_s, int inlet,
           double inlet_mL_s, const std::vector<FlowEnd>& ends, const Pulse& pulse,
           std::vector<StenosisLoss> stenoses, const Obstruction& obstruction)
    : graph_(std::move(graph)),
      pulse_(pulse),
      inlet_(inlet),
      stenoses_(std::move(stenoses)),
      obstruction_(obstruction),
      inlet_mL_s_(inlet_mL_s),
      mmHg_s_per_mL_mm3_(PoiseuilleMmHgSPerML(viscosity_Pa_s, 1)) {
  for (const FlowEnd& end : ends) {
    if (end.node == inlet) {
      inlet_mmHg_ = end.pressure_mmHg;
    } else {
      outlets_.push_back(end);
      has_windkessel_ = has_windkessel_ || end.compliance_mL_mmHg > 0;
    }
  }
  for (const FlowEdge& edge : graph_->edges()) {
    poiseuille_.push_back(PoiseuilleMmHgSPerML(
        viscosity_Pa_s, graph_->InverseFourthPower(edge.curve, edge.from_mm, edge.to_mm)));
  }
  stepped_ = has_windkessel_ || !stenoses_.empty() || obstruction_.wire != nullptr;
  Restart();
}

void Flow::Restart() {
  time_s_ = 0;
  obstruction_age_s_ = kObstructionS;
  obstructed_.assign(poiseuille_.size(), 0);
  SolveMean();
  now_ = mean_;
  moment_count_ = 0;
  if (!stepped_) return;
  // The initial stored pressures are those of the mean flow.
  stored_mmHg_.assign(outlets_.size(), 0);
  for (std::size_t k = 0; k < outlets_.size(); ++k) {
    stored_mmHg_[k] = now_.pressure_mmHg[static_cast<std::size_t>(outlets_[k].node)] -
                      outlets_[k].proximal_mmHg_s_mL * now_.end_mL_s[k];
  }
  step_losses_mL_s_.clear();
  for (const StenosisLoss& loss : stenoses_) {
    step_losses_mL_s_.push_back(std::abs(now_.edge_mL_s[static_cast<std::size_t>(loss.edge)]));
  }
  MakeStep();
}

void Flow::CopyFrom(const Effect& twin) {
  const auto& from = dynamic_cast<const Flow&>(twin);
  outlets_ = from.outlets_;
  inlet_mL_s_ = from.inlet_mL_s_;
  obstructed_ = from.obstructed_;
  version_ = from.version_;
  mean_ = from.mean_;
  exchange_ = from.exchange_;
  driven_ = from.driven_;
  muscle_ = from.muscle_;
  step_losses_mL_s_ = from.step_losses_mL_s_;
  stored_mmHg_ = from.stored_mmHg_;
  now_ = from.now_;
  time_s_ = from.time_s_;
  moments_ = from.moments_;
  moment_count_ = from.moment_count_;
  obstruction_age_s_ = from.obstruction_age_s_;
  steady_ = std::make_unique<FlowSolution>(*from.steady_, *graph_);
  if (stepped_) step_ = std::make_unique<FlowSolution>(*from.step_, *graph_);
}

std::vector<double> Flow::Inflow(double inlet_mL_s) const {
  std::vector<double> inflow(graph_->nodes().size(), 0);
  inflow[static_cast<std::size_t>(inlet_)] = inlet_mL_s;
  return inflow;
}

std::vector<double> Flow::Resistances(const std::vector<double>& stenosis_flow_mL_s) const {
  std::vector<double> all = poiseuille_;
  for (std::size_t e = 0; e < all.size(); ++e) all[e] += obstructed_[e];
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
  std::vector<double> pressures;
  std::vector<double> systolic;
  for (const FlowEnd& end : outlets_) {
    pressures.push_back(end.pressure_mmHg);
    systolic.push_back(end.systolic_mmHg);
  }
  const std::vector<double> none(outlets_.size(), 0);
  const double ejection = Pulse().Ejection(0);
  for (int round = 0; round < kMostRounds; ++round) {
    const std::vector<double> resistances = Resistances(losses_mL_s);
    steady_ = std::make_unique<FlowSolution>(*graph_, resistances, outlets_);
    exchange_ = steady_->Solve(Inflow(0), pressures);
    muscle_ = steady_->Solve(Inflow(0), systolic);
    if (inlet_mmHg_) {
      // Sets the inlet's mean flow to match its pressure, which is linear in the flow.
      const auto at = static_cast<std::size_t>(inlet_);
      const double unit_mmHg = steady_->Solve(Inflow(1), none).pressure_mmHg[at];
      inlet_mL_s_ =
          (*inlet_mmHg_ - exchange_.pressure_mmHg[at] - ejection * muscle_.pressure_mmHg[at]) /
          unit_mmHg;
    }
    driven_ = steady_->Solve(Inflow(inlet_mL_s_), none);
    mean_ = exchange_;
    const auto add = [&](std::vector<double> FlowSolution::Flows::*part) {
      for (std::size_t i = 0; i < (mean_.*part).size(); ++i) {
        (mean_.*part)[i] += (driven_.*part)[i] + ejection * (muscle_.*part)[i];
      }
    };
    add(&FlowSolution::Flows::edge_mL_s);
    add(&FlowSolution::Flows::pressure_mmHg);
    add(&FlowSolution::Flows::end_mL_s);
    if (!MoveLosses(stenoses_, mean_, losses_mL_s)) break;
  }
  ++version_;
}

// An implicit step of a Windkessel is a resistance with a pressure behind it:
//   C (p - p_before)/h = q - (p - behind)/R,   end = p + proximal q.
void Flow::MakeStep() {
  std::vector<FlowEnd> ends = outlets_;
  for (FlowEnd& end : ends) {
    if (end.compliance_mL_mmHg == 0) continue;
    end.resistance_mmHg_s_mL = 1 / (end.compliance_mL_mmHg / kStepS + 1 / end.resistance_mmHg_s_mL);
  }
  step_ = std::make_unique<FlowSolution>(*graph_, Resistances(step_losses_mL_s_), std::move(ends));
}

void Flow::Step() {
  time_s_ += kStepS;
  const std::vector<double> inflow = Inflow(inlet_mL_s_ * pulse_.At(time_s_));
  const double ejection = pulse_.Ejection(time_s_);
  std::vector<double> behind(outlets_.size(), 0);
  for (std::size_t k = 0; k < outlets_.size(); ++k) {
    const FlowEnd& end = outlets_[k];
    behind[k] = end.pressure_mmHg + ejection * end.systolic_mmHg;
    if (end.compliance_mL_mmHg == 0) continue;
    behind[k] =
        (end.compliance_mL_mmHg / kStepS * stored_mmHg_[k] + behind[k] / end.resistance_mmHg_s_mL) *
        step_->ends()[k].resistance_mmHg_s_mL;
  }
  for (int round = 0; round < kMostRounds; ++round) {
    now_ = step_->Solve(inflow, behind);
    if (!MoveLosses(stenoses_, now_, step_losses_mL_s_)) break;
    MakeStep();
  }
  for (std::size_t k = 0; k < outlets_.size(); ++k) {
    if (outlets_[k].compliance_mL_mmHg == 0) continue;
    stored_mmHg_[k] = behind[k] + step_->ends()[k].resistance_mmHg_s_mL * now_.end_mL_s[k];
  }
}

void Flow::AdvanceTo(double time_s) {
  if (!stepped_) return;
  constexpr double kEarlyS = 1e-9;
  moment_count_ = 0;
  while (time_s_ + kStepS <= time_s + kEarlyS) {
    Step();
    if (moments_.size() == moment_count_) moments_.emplace_back();
    moments_[moment_count_].time_s = time_s_;
    moments_[moment_count_++].edge_mL_s = now_.edge_mL_s;
  }
}

void Flow::Advance(const TickView& tick) {
  if (obstruction_.wire != nullptr) {
    obstruction_age_s_ += tick.step_s;
    if (obstruction_age_s_ >= kObstructionS) {
      obstruction_age_s_ = 0;
      Obstruct(tick.state, tick.expansion.points);
    }
  }
  AdvanceTo(tick.time_s);
}

void Flow::Obstruct(const WireState& state, const PointSet& points) {
  const WireModel& wire = *obstruction_.wire;
  const vessel::CenterlineNetwork& network = graph_->network();
  std::vector<double> more(obstructed_.size(), 0);
  const int n = state.segments();
  const int stride = std::max(1, static_cast<int>(kObstructionStepMm / wire.segment_mm()));
  for (int i = 0; i < n; i += stride) {
    const int last = std::min(n, i + stride);
    double length_mm = 0;
    for (int k = i; k < last; ++k) length_mm += state.SegmentLength(wire, k);
    const auto a = static_cast<std::size_t>(i);
    const auto b = static_cast<std::size_t>(last);
    Eigen::Vector3d middle = (state.nodes()[a] + state.nodes()[b]) / 2;
    if (obstruction_.moving != nullptr) middle = obstruction_.moving->AtRest(middle);
    double distance_mm = 0;
    const vessel::CenterlinePlace place = network.NearestTo(middle, &distance_mm);
    const double tube_mm = network.At(place).radius_mm;
    if (distance_mm > tube_mm) continue;
    const double core_mm = std::min(
        kMostFilled * tube_mm,
        points
            .radius_mm[static_cast<std::size_t>(i) * static_cast<std::size_t>(points.per_segment)]);
    more[static_cast<std::size_t>(graph_->EdgeAt(place))] +=
        mmHg_s_per_mL_mm3_ * length_mm *
        (AnnulusInverseFourthPower(tube_mm, core_mm) - AnnulusInverseFourthPower(tube_mm, 0));
  }
  constexpr double kNoticed = 1e-3;
  bool same = true;
  for (std::size_t e = 0; e < more.size(); ++e) {
    same = same && std::abs(more[e] - obstructed_[e]) <= kNoticed * (poiseuille_[e] + more[e]);
  }
  if (same) return;
  obstructed_ = std::move(more);
  SolveMean();
  MakeStep();
}

void Flow::EdgesAt(double time_s, std::vector<double>& edge_mL_s) const {
  if (stepped_) {
    edge_mL_s = now_.edge_mL_s;
    for (std::size_t k = 0; k < moment_count_; ++k) {
      if (moments_[k].time_s < time_s) continue;
      edge_mL_s = moments_[k].edge_mL_s;
      break;
    }
    return;
  }
  const double factor = pulse_.At(time_s);
  const double ejection = pulse_.Ejection(time_s);
  edge_mL_s.resize(mean_.edge_mL_s.size());
  for (std::size_t e = 0; e < edge_mL_s.size(); ++e) {
    edge_mL_s[e] =
        exchange_.edge_mL_s[e] + factor * driven_.edge_mL_s[e] + ejection * muscle_.edge_mL_s[e];
  }
}

namespace {

enum class CurveEnd { kStart, kEnd };
enum class Outlets { kAutomatic, kMurray, kPressure };

struct OutletSpec : TableSpec {
  std::string centerline;
  CurveEnd end = CurveEnd::kEnd;
  std::optional<double> pressure_mmHg;
  std::optional<double> resistance_mmHg_s_mL;
  double compliance_mL_mmHg = 0;
  double proximal_mmHg_s_mL = 0;
  double systolic_mmHg = 0;
};

struct StenosisSpec : TableSpec {
  std::string centerline;
  double from_mm = 0;
  double to_mm = 0;
};

struct FlowSpec : TableSpec {
  std::string inlet;
  CurveEnd inlet_end = CurveEnd::kStart;
  std::optional<double> inlet_mL_s;
  std::optional<double> inlet_mmHg;
  double viscosity_mPa_s = 3.5;
  Outlets outlets = Outlets::kAutomatic;
  double bed_mmHg = 90;
  double murray_exponent = 3;
  double outlet_mmHg = 0;
  double compliance_mL_mmHg = 0;
  double rate_per_min = 0;
  double pulsatility = 0.5;
  bool obstruction = false;
  std::vector<OutletSpec> outlet;
  std::vector<StenosisSpec> stenosis;
};

const Keys<OutletSpec>& OutletKeys() {
  static const Keys<OutletSpec> keys =
      Keys<OutletSpec>()
          .Required()
          .Text("centerline", &OutletSpec::centerline, "whose free end the outlet is")
          .Choice("end", &OutletSpec::end, {"start", "end"}, "which end of it")
          .Otherwise("0 behind a resistance; required without one")
          .Number("pressure_mmHg", &OutletSpec::pressure_mmHg, -50, 500, "mmHg",
                  "at the outlet, or behind its resistance")
          .Otherwise("none: the pressure holds at the outlet")
          .Number("resistance_mmHg_s_mL", &OutletSpec::resistance_mmHg_s_mL, 1e-6, 1e6, "mmHg s/mL",
                  "of the vessels behind the outlet")
          .Number("compliance_mL_mmHg", &OutletSpec::compliance_mL_mmHg, 0, 100, "mL/mmHg",
                  "of a Windkessel, between the end and the resistance; 0: none")
          .Number("proximal_mmHg_s_mL", &OutletSpec::proximal_mmHg_s_mL, 0, 1e6, "mmHg s/mL",
                  "resistance between the end and the compliance")
          .Number("systolic_mmHg", &OutletSpec::systolic_mmHg, 0, 500, "mmHg",
                  "by which the heart's muscle presses on the vessels behind the outlet at the "
                  "height of the ejection; makes the flow of coronary arteries diastolic")
          .Checked([](const OutletSpec& spec, StrictTable& table) {
            if (!spec.resistance_mmHg_s_mL && !spec.pressure_mmHg) {
              table.Refuse("pressure_mmHg", "is missing; give it, or resistance_mmHg_s_mL");
            }
            for (const char* key : {"compliance_mL_mmHg", "proximal_mmHg_s_mL", "systolic_mmHg"}) {
              if (!table.Has(key) || spec.resistance_mmHg_s_mL) continue;
              table.Refuse(key, "needs resistance_mmHg_s_mL; give that or remove this");
            }
          });
  return keys;
}

const Keys<StenosisSpec>& StenosisKeys() {
  static const Keys<StenosisSpec> keys =
      Keys<StenosisSpec>()
          .Required()
          .Text("centerline", &StenosisSpec::centerline, "on which it is")
          .Required()
          .Number("from_mm", &StenosisSpec::from_mm, 0, 1e5, "mm",
                  "where it begins, by arc length; its throat is the narrowest place within")
          .Required()
          .Number("to_mm", &StenosisSpec::to_mm, 0, 1e5, "mm",
                  "where it ends; the wider end is the lumen into which the blood widens");
  return keys;
}

void Check(const FlowSpec& spec, StrictTable& table) {
  if (spec.inlet_mL_s.has_value() == spec.inlet_mmHg.has_value()) {
    table.Refuse("inlet", "give one of inlet_mL_s and inlet_mmHg with it, not both or none");
  }
  if (spec.outlets == Outlets::kMurray && !spec.inlet_mL_s) {
    table.Refuse("outlets",
                 "needs inlet_mL_s, of which the outlets' resistances are made; give that instead "
                 "of inlet_mmHg, or outlets = \"pressure\"");
  }
}

const Keys<FlowSpec>& FlowKeys() {
  static const Keys<FlowSpec> keys =
      Keys<FlowSpec>()
          .Required()
          .Text("inlet", &FlowSpec::inlet, "centerline at whose free end the blood comes in")
          .Choice("inlet_end", &FlowSpec::inlet_end, {"start", "end"}, "which end of it")
          .Otherwise("give inlet_mmHg")
          .Number("inlet_mL_s", &FlowSpec::inlet_mL_s, 1e-3, 1000, "mL/s", "mean flow in")
          .Otherwise("give inlet_mL_s")
          .Number("inlet_mmHg", &FlowSpec::inlet_mmHg, -50, 500, "mmHg", "pressure at the inlet")
          .Number("viscosity_mPa_s", &FlowSpec::viscosity_mPa_s, 0.1, 100, "mPa s", "of blood")
          .Choice("outlets", &FlowSpec::outlets, {"automatic", "murray", "pressure"},
                  "all outlets: resistances by Murray's law, or one pressure; automatic: the first "
                  "with inlet_mL_s, the second with inlet_mmHg")
          .Number("bed_mmHg", &FlowSpec::bed_mmHg, 1, 500, "mmHg",
                  "what the vessels behind the outlets take of the pressure at the mean flow")
          .Number("murray_exponent", &FlowSpec::murray_exponent, 1, 4, "",
                  "an outlet's share of the flow grows as its radius to this power")
          .Number("outlet_mmHg", &FlowSpec::outlet_mmHg, -50, 500, "mmHg",
                  "pressure behind the resistances, or at the outlets where there are none")
          .Number("compliance_mL_mmHg", &FlowSpec::compliance_mL_mmHg, 0, 100, "mL/mmHg",
                  "of the vessels behind all outlets by Murray's law together, which makes them "
                  "Windkessels; 0: none")
          .Number("rate_per_min", &FlowSpec::rate_per_min, 0, 300, "1/min", "heart rate; 0: steady")
          .Number("pulsatility", &FlowSpec::pulsatility, 0, 1, "",
                  "part of the flow in that comes only in systole")
          .Boolean("obstruction", &FlowSpec::obstruction,
                   "whether instruments narrow the lumen, as if they lay in its middle")
          .Tables("outlet", &FlowSpec::outlet, OutletKeys(), 0, "an outlet that differs")
          .Tables("stenosis", &FlowSpec::stenosis, StenosisKeys(), 0,
                  "a narrow stretch behind which pressure is lost (Young and Tsai)")
          .Checked(Check)
          .Example(
              "inlet = \"aorta\"\n"
              "inlet_mL_s = 80\n"
              "rate_per_min = 72\n"
              "pulsatility = 0.4\n"
              "[[effects.flow.outlet]]\n"
              "centerline = \"lad\"\n"
              "resistance_mmHg_s_mL = 100\n");
  return keys;
}

const char* NameOf(CurveEnd end) { return end == CurveEnd::kStart ? "start" : "end"; }

double RadiusAt(const FlowGraph& graph, int node) {
  return graph.network().At(graph.nodes()[static_cast<std::size_t>(node)].place).radius_mm;
}

// Outlets named by tables, by node.
std::vector<FlowEnd> NamedOutlets(const FlowSpec& spec, const FlowGraph& graph, int inlet) {
  std::vector<FlowEnd> named;
  for (const OutletSpec& outlet : spec.outlet) {
    const std::string side = NameOf(outlet.end);
    FlowEnd end;
    try {
      end.node = graph.NodeAt(outlet.centerline, side);
    } catch (const UserError& error) {
      outlet.origin.Refuse("centerline", error.what());
    }
    if (!graph.nodes()[static_cast<std::size_t>(end.node)].is_end() || end.node == inlet) {
      outlet.origin.Refuse("centerline",
                           "its " + side + " is no outlet: it is " +
                               (end.node == inlet ? "the inlet" : "joined to others") +
                               "; name a free end");
    }
    for (const FlowEnd& other : named) {
      if (other.node == end.node) {
        outlet.origin.Refuse("centerline", "this outlet is named twice");
      }
    }
    end.is_pressure = !outlet.resistance_mmHg_s_mL;
    end.resistance_mmHg_s_mL = outlet.resistance_mmHg_s_mL.value_or(0);
    end.pressure_mmHg = outlet.pressure_mmHg.value_or(0);
    end.compliance_mL_mmHg = outlet.compliance_mL_mmHg;
    end.proximal_mmHg_s_mL = outlet.proximal_mmHg_s_mL;
    end.systolic_mmHg = outlet.systolic_mmHg;
    named.push_back(end);
  }
  return named;
}

void CheckConnected(const FlowSpec& spec, const FlowGraph& graph, int inlet) {
  const std::vector<bool> reached = graph.ReachedFrom(inlet);
  for (std::size_t n = 0; n < reached.size(); ++n) {
    if (reached[n]) continue;
    spec.origin.Refuse("inlet", "the outlet " + graph.NameOf(static_cast<int>(n)) +
                                    " is not connected to it; join the curves (their ends must "
                                    "lie on one another) or take that one away");
  }
}

// All free ends but the inlet: named ones from their tables, the others from the scene's general
// setting.
std::vector<FlowEnd> AllOutlets(const FlowSpec& spec, const FlowGraph& graph, int inlet) {
  std::vector<FlowEnd> ends = NamedOutlets(spec, graph, inlet);
  const bool murray =
      spec.outlets == Outlets::kMurray || (spec.outlets == Outlets::kAutomatic && spec.inlet_mL_s);
  std::vector<int> free;
  double shares = 0;
  for (std::size_t n = 0; n < graph.nodes().size(); ++n) {
    const int node = static_cast<int>(n);
    if (!graph.nodes()[n].is_end() || node == inlet) continue;
    shares += std::pow(RadiusAt(graph, node), spec.murray_exponent);
    bool is_named = false;
    for (const FlowEnd& end : ends) is_named = is_named || end.node == node;
    if (!is_named) free.push_back(node);
  }
  for (const int node : free) {
    const double share = std::pow(RadiusAt(graph, node), spec.murray_exponent) / shares;
    ends.push_back({.node = node,
                    .is_pressure = !murray,
                    .pressure_mmHg = spec.outlet_mmHg,
                    .resistance_mmHg_s_mL = murray ? spec.bed_mmHg / (share * *spec.inlet_mL_s) : 0,
                    .compliance_mL_mmHg = murray ? share * spec.compliance_mL_mmHg : 0});
  }
  if (ends.empty()) {
    spec.origin.Refuse("inlet", "there is no outlet: the network has no other free end");
  }
  return ends;
}

StenosisLoss MakeStenosis(const StenosisSpec& spec, const FlowGraph& graph) {
  const vessel::CenterlineNetwork& network = graph.network();
  constexpr double kLookMm = 0.1;
  const auto radius_at = [&](double s_mm) {
    try {
      return network.At(network.Place(spec.centerline, s_mm)).radius_mm;
    } catch (const UserError& error) {
      spec.origin.Refuse("centerline", error.what());
    }
  };
  const double wide_mm = std::max(radius_at(spec.from_mm), radius_at(spec.to_mm));
  if (!(spec.to_mm > spec.from_mm)) spec.origin.Refuse("to_mm", "must be more than from_mm");
  double throat_mm = wide_mm;
  double throat_at_mm = spec.from_mm;
  for (double s_mm = spec.from_mm; s_mm <= spec.to_mm; s_mm += kLookMm) {
    if (radius_at(s_mm) >= throat_mm) continue;
    throat_mm = radius_at(s_mm);
    throat_at_mm = s_mm;
  }
  if (!(throat_mm < wide_mm)) {
    spec.origin.Refuse("from_mm",
                       "the centerline is nowhere narrower than at the ends of this stretch; move "
                       "it to the stenosis or remove it");
  }
  const auto area = [](double r_mm) { return std::numbers::pi * r_mm * r_mm; };
  return {.edge = graph.EdgeAt(network.Place(spec.centerline, throat_at_mm)),
          .loss_mmHg_s2_mL2 = StenosisLossMmHg(area(wide_mm), area(throat_mm))};
}

std::unique_ptr<Effect> MakeFlow(const FlowSpec& spec, const EffectContext& context) {
  if (context.centerlines == nullptr || context.centerlines->empty()) {
    spec.origin.Refuse("inlet",
                       "this vessel has no centerlines, along which blood could flow; give "
                       "vessel.centerlines, or remove [effects.flow]");
  }
  std::unique_ptr<const FlowGraph> graph;
  int inlet = 0;
  const std::string side = NameOf(spec.inlet_end);
  try {
    graph = std::make_unique<FlowGraph>(*context.centerlines);
    inlet = graph->NodeAt(spec.inlet, side);
  } catch (const UserError& error) {
    spec.origin.Refuse("inlet", error.what());
  }
  if (!graph->nodes()[static_cast<std::size_t>(inlet)].is_end()) {
    spec.origin.Refuse("inlet", "its " + side + " is joined to other curves; name a free end");
  }
  CheckConnected(spec, *graph, inlet);
  std::vector<FlowEnd> ends = AllOutlets(spec, *graph, inlet);
  if (spec.inlet_mmHg) {
    ends.push_back({.node = inlet, .is_pressure = true, .pressure_mmHg = *spec.inlet_mmHg});
  }
  std::vector<StenosisLoss> stenoses;
  for (const StenosisSpec& stenosis : spec.stenosis) {
    stenoses.push_back(MakeStenosis(stenosis, *graph));
  }
  Obstruction obstruction;
  if (spec.obstruction) obstruction = {&context.wire, context.moving};
  return std::make_unique<Flow>(
      std::move(graph), 1e-3 * spec.viscosity_mPa_s, inlet, spec.inlet_mL_s.value_or(0), ends,
      Pulse{spec.rate_per_min, spec.pulsatility}, std::move(stenoses), obstruction);
}

}  // namespace

EffectKind FlowKind() {
  return {.name = "flow",
          .summary = "blood flow in the centerline network, steady or pulsatile, with Windkessels",
          .roles = "evolution",
          .keys = Any(FlowKeys()),
          .make = MakeWith(MakeFlow)};
}

}  // namespace torquer::effects
