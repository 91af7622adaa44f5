#include "host/simulator/effects/flow.h"

#include <cmath>
#include <numbers>

#include "host/support/error.h"

namespace torquer::effects {

namespace {

constexpr double kEjection = 0.35;  // of a cycle

std::vector<double> Resistances(const FlowGraph& graph, double viscosity_Pa_s) {
  std::vector<double> all;
  for (const FlowEdge& edge : graph.edges()) {
    all.push_back(PoiseuilleMmHgSPerML(
        viscosity_Pa_s, graph.InverseFourthPower(edge.curve, edge.from_mm, edge.to_mm)));
  }
  return all;
}

std::vector<double> Inflow(const FlowGraph& graph, int inlet, double inlet_mL_s) {
  std::vector<double> inflow(graph.nodes().size(), 0);
  inflow[static_cast<std::size_t>(inlet)] = inlet_mL_s;
  return inflow;
}

const Key kViscosity = {"viscosity_mPa_s", "mPa s", 0.1, 100, 3.5, "of blood"};
const Key kBed = {
    "bed_mmHg", "mmHg",
    1,          500,
    90,         "what the vessels behind the outlets take of the pressure at the mean flow"};
const Key kExponent = {"murray_exponent",
                       "",
                       1,
                       4,
                       3,
                       "an outlet's share of the flow grows as its radius to this power"};
const Key kOutletPressure = {
    "outlet_mmHg", "mmHg", -50,
    500,           0,      "pressure behind the beds, or at the outlets where there are none"};
const Key kRate = {"rate_per_min", "1/min", 0, 300, 0, "heart rate; 0: steady"};
const Key kPulsatility = {
    "pulsatility", "", 0, 1, 0.5, "part of the flow that comes only in systole"};

double RadiusAt(const FlowGraph& graph, int node) {
  return graph.network().At(graph.nodes()[static_cast<std::size_t>(node)].place).radius_mm;
}

// The outlets that tables name, by node.
std::vector<FlowEnd> ReadNamedOutlets(StrictTable& keys, const FlowGraph& graph, int inlet) {
  std::vector<FlowEnd> named;
  for (StrictTable* table : keys.Tables("outlet")) {
    const std::string curve = table->Text("centerline");
    const std::string side = table->Choice("end", {"start", "end"}, 1) == 0 ? "start" : "end";
    FlowEnd end;
    try {
      end.node = graph.NodeAt(curve, side);
    } catch (const UserError& error) {
      table->Refuse("centerline", error.what());
    }
    if (!graph.nodes()[static_cast<std::size_t>(end.node)].is_end() || end.node == inlet) {
      table->Refuse("centerline", "its " + side + " is no outlet: it is " +
                                      (end.node == inlet ? "the inlet" : "joined to others") +
                                      "; name a free end");
    }
    for (const FlowEnd& other : named) {
      if (other.node == end.node) table->Refuse("centerline", "this outlet is named twice");
    }
    end.is_pressure = !table->Has("resistance_mmHg_s_mL");
    if (!end.is_pressure) {
      end.resistance_mmHg_s_mL = table->Number("resistance_mmHg_s_mL", 1e-6, 1e6);
    }
    end.pressure_mmHg = end.is_pressure ? table->Number("pressure_mmHg", -50, 500)
                                        : table->Number("pressure_mmHg", -50, 500, 0);
    named.push_back(end);
  }
  return named;
}

void CheckConnected(StrictTable& keys, const FlowGraph& graph, int inlet) {
  const std::vector<bool> reached = graph.ReachedFrom(inlet);
  for (std::size_t n = 0; n < reached.size(); ++n) {
    if (reached[n]) continue;
    keys.Refuse("inlet", "the outlet " + graph.NameOf(static_cast<int>(n)) +
                             " is not connected to it; join the curves (their ends must lie on "
                             "one another) or take that one away");
  }
}

// All free ends but the inlet: as named, else as the scene says for all.
std::vector<FlowEnd> ReadOutlets(StrictTable& keys, const FlowGraph& graph, int inlet,
                                 double inlet_mL_s) {
  std::vector<FlowEnd> ends = ReadNamedOutlets(keys, graph, inlet);
  const bool murray = keys.Choice("outlets", {"murray", "pressure"}, inlet_mL_s > 0 ? 0 : 1) == 0;
  if (murray && !(inlet_mL_s > 0)) {
    keys.Refuse("outlets",
                "needs inlet_mL_s, of which the outlets' resistances are made; give "
                "that instead of inlet_mmHg, or \"pressure\"");
  }
  const double bed_mmHg = kBed.Read(keys);
  const double exponent = kExponent.Read(keys);
  const double outlet_mmHg = kOutletPressure.Read(keys);
  std::vector<int> free;
  double shares = 0;
  for (std::size_t n = 0; n < graph.nodes().size(); ++n) {
    const int node = static_cast<int>(n);
    if (!graph.nodes()[n].is_end() || node == inlet) continue;
    shares += std::pow(RadiusAt(graph, node), exponent);
    bool is_named = false;
    for (const FlowEnd& end : ends) is_named = is_named || end.node == node;
    if (!is_named) free.push_back(node);
  }
  for (const int node : free) {
    const double share = std::pow(RadiusAt(graph, node), exponent) / shares;
    ends.push_back({.node = node,
                    .is_pressure = !murray,
                    .pressure_mmHg = outlet_mmHg,
                    .resistance_mmHg_s_mL = murray ? bed_mmHg / (share * inlet_mL_s) : 0});
  }
  if (ends.empty()) keys.Refuse("inlet", "there is no outlet: the network has no other free end");
  return ends;
}

std::unique_ptr<Effect> MakeFlow(StrictTable& keys, const EffectContext& context) {
  if (context.centerlines == nullptr || context.centerlines->empty()) {
    keys.Refuse("inlet",
                "this vessel has no centerlines, along which blood could flow; give "
                "vessel.centerlines, or remove [effects.flow]");
  }
  std::unique_ptr<const FlowGraph> graph;
  int inlet = 0;
  const std::string curve = keys.Text("inlet");
  const std::string side = keys.Choice("inlet_end", {"start", "end"}, 0) == 0 ? "start" : "end";
  try {
    graph = std::make_unique<FlowGraph>(*context.centerlines);
    inlet = graph->NodeAt(curve, side);
  } catch (const UserError& error) {
    keys.Refuse("inlet", error.what());
  }
  if (!graph->nodes()[static_cast<std::size_t>(inlet)].is_end()) {
    keys.Refuse("inlet", "its " + side + " is joined to other curves; name a free end");
  }
  CheckConnected(keys, *graph, inlet);
  if (keys.Has("inlet_mL_s") == keys.Has("inlet_mmHg")) {
    keys.Refuse("inlet", "give one of inlet_mL_s and inlet_mmHg with it, not both or none");
  }
  double inlet_mL_s = 0;
  FlowEnd pressed{.node = inlet, .is_pressure = true};
  if (keys.Has("inlet_mL_s")) {
    inlet_mL_s = keys.Number("inlet_mL_s", 1e-3, 1000);
  } else {
    pressed.pressure_mmHg = keys.Number("inlet_mmHg", -50, 500);
  }
  std::vector<FlowEnd> ends = ReadOutlets(keys, *graph, inlet, inlet_mL_s);
  if (!(inlet_mL_s > 0)) ends.push_back(pressed);
  const double viscosity_Pa_s = 1e-3 * kViscosity.Read(keys);
  const double rate = kRate.Read(keys);
  const Pulse pulse{rate, kPulsatility.Read(keys)};
  return std::make_unique<Flow>(std::move(graph), viscosity_Pa_s, inlet, inlet_mL_s,
                                std::move(ends), pulse);
}

}  // namespace

double PoiseuilleMmHgSPerML(double viscosity_Pa_s, double inverse_fourth_power_1_mm3) {
  constexpr double kMm3PerML = 1e3;
  constexpr double kPaPerMmHg = 133.322387415;
  return 8 * viscosity_Pa_s / std::numbers::pi * inverse_fourth_power_1_mm3 * kMm3PerML /
         kPaPerMmHg;
}

double Pulse::At(double time_s) const {
  if (per_minute <= 0) return 1;
  const double cycles = time_s * per_minute / 60;
  const double phase = cycles - std::floor(cycles);
  const double wave = phase < kEjection ? std::sin(std::numbers::pi * phase / kEjection) : 0;
  return 1 - depth + depth * wave * wave * 2 / kEjection;
}

Flow::Flow(std::unique_ptr<const FlowGraph> graph, double viscosity_Pa_s, int inlet,
           double inlet_mL_s, std::vector<FlowEnd> ends, const Pulse& pulse)
    : graph_(std::move(graph)),
      solution_(*graph_, Resistances(*graph_, viscosity_Pa_s), std::move(ends)),
      mean_(solution_.Solve(Inflow(*graph_, inlet, inlet_mL_s), true)),
      pulse_(pulse),
      inlet_(inlet) {}

EffectKind FlowKind() {
  return {.name = "flow",
          .summary = "blood flow in the centerline network, steady or pulsatile (quasi-steady)",
          .roles = "evolution",
          .keys = {kViscosity, kBed, kExponent, kOutletPressure, kRate, kPulsatility},
          .other_keys =
              {{"inlet", "text", "the centerline at whose free end the blood comes in"},
               {"inlet_end", "\"start\" or \"end\", if not given \"start\"", "which end of it"},
               {"inlet_mL_s", "0.001 to 1000 mL/s", "mean flow in; this or inlet_mmHg"},
               {"inlet_mmHg", "-50 to 500 mmHg", "pressure at the inlet; this or inlet_mL_s"},
               {"outlets", "\"murray\" or \"pressure\"; if not given \"murray\" with inlet_mL_s",
                "beds of a resistance by Murray's law, or one pressure at all outlets"},
               {"outlet", "tables of centerline, end, pressure_mmHg, resistance_mmHg_s_mL",
                "an outlet that is otherwise: a pressure (-50 to 500 mmHg), or a resistance (1e-6 "
                "to 1e6 mmHg s/mL) with the pressure behind it"}},
          .needs = "",
          .make = MakeFlow};
}

}  // namespace torquer::effects
