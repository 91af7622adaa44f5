#include <algorithm>
#include <cmath>
#include <memory>
#include <string>
#include <utility>
#include <vector>

#include "host/simulator/effects/blood/flow.h"
#include "host/support/error.h"

namespace torquer::effects {

namespace {

constexpr double kPulsatility = 0.5;  // of a flow source, if the scene gives none

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

struct InletSpec : TableSpec {
  std::string centerline;
  CurveEnd end = CurveEnd::kStart;
  double mL_s = 0;
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
  std::optional<double> inlet_mean_mmHg;
  std::optional<double> inlet_held_mmHg;
  double inlet_resistance_mmHg_s_mL = 0;
  double viscosity_mPa_s = 3.5;
  Outlets outlets = Outlets::kAutomatic;
  double bed_mmHg = 90;
  double murray_exponent = 3;
  double outlet_mmHg = 0;
  double compliance_mL_mmHg = 0;
  double rate_per_min = 0;
  std::optional<double> pulsatility;
  bool obstruction = false;
  std::vector<InletSpec> other_inlet;
  std::vector<OutletSpec> outlet;
  std::vector<StenosisSpec> stenosis;
};

const Keys<OutletSpec>& OutletKeys() {
  static const Keys<OutletSpec> keys =
      Keys<OutletSpec>()
          .Required()
          .Text("centerline", &OutletSpec::centerline, "centerline whose free end is the outlet")
          .Choice("end", &OutletSpec::end, {"start", "end"},
                  "end of the centerline at which the outlet lies")
          .Otherwise("0 behind a resistance; required without one")
          .Number("pressure_mmHg", &OutletSpec::pressure_mmHg, -50, 500, "mmHg",
                  "pressure at the outlet, or behind its resistance if it has one")
          .Otherwise("none: the pressure acts at the outlet itself")
          .Number("resistance_mmHg_s_mL", &OutletSpec::resistance_mmHg_s_mL, 1e-6, 1e6, "mmHg s/mL",
                  "resistance of the vessels behind the outlet")
          .Number(
              "compliance_mL_mmHg", &OutletSpec::compliance_mL_mmHg, 0, 100, "mL/mmHg",
              "compliance of a Windkessel between the outlet and its resistance; 0: no Windkessel")
          .Number("proximal_mmHg_s_mL", &OutletSpec::proximal_mmHg_s_mL, 0, 1e6, "mmHg s/mL",
                  "proximal resistance, between the outlet and the compliance")
          .Number("systolic_mmHg", &OutletSpec::systolic_mmHg, 0, 500, "mmHg",
                  "peak pressure of the heart muscle on the vessels behind the outlet; it makes "
                  "coronary flow diastolic")
          .Checked([](const OutletSpec& spec, StrictTable& table) {
            if (!spec.resistance_mmHg_s_mL && !spec.pressure_mmHg) {
              table.Refuse("pressure_mmHg", "is missing; give it, or resistance_mmHg_s_mL");
            }
            for (const char* key : {"compliance_mL_mmHg", "proximal_mmHg_s_mL", "systolic_mmHg"}) {
              if (!table.Has(key) || spec.resistance_mmHg_s_mL) continue;
              table.Refuse(key, "needs resistance_mmHg_s_mL; give that key, or remove this one");
            }
          });
  return keys;
}

const Keys<InletSpec>& InletKeys() {
  static const Keys<InletSpec> keys =
      Keys<InletSpec>()
          .Required()
          .Text("centerline", &InletSpec::centerline, "centerline whose free end is the inlet")
          .Choice("end", &InletSpec::end, {"start", "end"},
                  "end of the centerline at which the inlet lies")
          .Required()
          .Number("mL_s", &InletSpec::mL_s, 1e-3, 1000, "mL/s",
                  "mean flow of a flow source at this inlet; the pulse of the flow acts on it too");
  return keys;
}

const Keys<StenosisSpec>& StenosisKeys() {
  static const Keys<StenosisSpec> keys =
      Keys<StenosisSpec>()
          .Required()
          .Text("centerline", &StenosisSpec::centerline, "centerline on which the stenosis lies")
          .Required()
          .Number("from_mm", &StenosisSpec::from_mm, 0, 1e5, "mm",
                  "arc length at which the stenosis begins; its throat is the narrowest place "
                  "between from_mm and to_mm")
          .Required()
          .Number("to_mm", &StenosisSpec::to_mm, 0, 1e5, "mm",
                  "arc length at which the stenosis ends; the wider of its two ends is the lumen "
                  "into which the jet expands");
  return keys;
}

void Check(const FlowSpec& spec, StrictTable& table) {
  const int given = int{spec.inlet_mL_s.has_value()} + int{spec.inlet_mean_mmHg.has_value()} +
                    int{spec.inlet_held_mmHg.has_value()};
  if (given != 1) {
    table.Refuse("inlet",
                 "needs exactly one of inlet_mL_s (a flow source), inlet_mean_mmHg (a flow source "
                 "with that mean pressure) and inlet_held_mmHg (a pressure source)");
  }
  if (table.Has("inlet_resistance_mmHg_s_mL") && !spec.inlet_held_mmHg) {
    table.Refuse("inlet_resistance_mmHg_s_mL",
                 "is a resistance of a pressure source, and the inlet is a flow source; give "
                 "inlet_held_mmHg as its pressure, or remove this key");
  }
  if (spec.outlets == Outlets::kMurray && !spec.inlet_mL_s) {
    table.Refuse("outlets",
                 "needs inlet_mL_s, from which murray computes the resistances of the outlets; "
                 "give inlet_mL_s instead of the inlet's pressure, or set outlets = \"pressure\"");
  }
}

const Keys<FlowSpec>& FlowKeys() {
  static const Keys<FlowSpec> keys =
      Keys<FlowSpec>()
          .Required()
          .Text("inlet", &FlowSpec::inlet, "centerline whose free end is the inlet")
          .Choice("inlet_end", &FlowSpec::inlet_end, {"start", "end"},
                  "end of the centerline at which the inlet lies")
          .Otherwise("give inlet_mean_mmHg or inlet_held_mmHg")
          .Number("inlet_mL_s", &FlowSpec::inlet_mL_s, 1e-3, 1000, "mL/s",
                  "mean flow of a flow source at the inlet, which no injection reduces")
          .Otherwise("give inlet_mL_s or inlet_held_mmHg")
          .Number("inlet_mean_mmHg", &FlowSpec::inlet_mean_mmHg, -50, 500, "mmHg",
                  "mean pressure of a flow source at the inlet; it sets the mean flow, which no "
                  "injection reduces")
          .Otherwise("give inlet_mL_s or inlet_mean_mmHg")
          .Number("inlet_held_mmHg", &FlowSpec::inlet_held_mmHg, -50, 500, "mmHg",
                  "pressure of a pressure source at the inlet; an injection reduces its flow")
          .Number("inlet_resistance_mmHg_s_mL", &FlowSpec::inlet_resistance_mmHg_s_mL, 0, 1e6,
                  "mmHg s/mL", "resistance between the pressure source and the inlet")
          .Number("viscosity_mPa_s", &FlowSpec::viscosity_mPa_s, 0.1, 100, "mPa s",
                  "dynamic viscosity of the blood")
          .Choice("outlets", &FlowSpec::outlets, {"automatic", "murray", "pressure"},
                  "model of all outlets: resistances by Murray's law, or one pressure; automatic: "
                  "pressure in the part of the vessel with a pressure at the inlet, else murray")
          .Number("bed_mmHg", &FlowSpec::bed_mmHg, 1, 500, "mmHg",
                  "pressure drop over the vessels behind the outlets at the mean flow")
          .Number("murray_exponent", &FlowSpec::murray_exponent, 1, 4, "",
                  "exponent of Murray's law: an outlet's share of the flow grows as its radius to "
                  "this power")
          .Number("outlet_mmHg", &FlowSpec::outlet_mmHg, -50, 500, "mmHg",
                  "pressure behind the resistances, or at outlets without one")
          .Number("compliance_mL_mmHg", &FlowSpec::compliance_mL_mmHg, 0, 100, "mL/mmHg",
                  "total compliance of the Windkessels behind the outlets with resistances by "
                  "Murray's law; 0: no Windkessels")
          .Number("rate_per_min", &FlowSpec::rate_per_min, 0, 300, "1/min",
                  "heart rate; 0: steady flow")
          .Otherwise("0.5; 0 with inlet_held_mmHg")
          .Number(
              "pulsatility", &FlowSpec::pulsatility, 0, 1, "",
              "fraction of the flow or the held pressure at the inlet that is there only during "
              "systole")
          .Boolean("obstruction", &FlowSpec::obstruction,
                   "true: instruments narrow the lumen, as if each lay on the centerline")
          .Tables("other_inlet", &FlowSpec::other_inlet, InletKeys(), 0,
                  "further inlets; each part of the vessel that is not connected to the inlet "
                  "needs one")
          .Tables("outlet", &FlowSpec::outlet, OutletKeys(), 0,
                  "outlets with values other than the common ones")
          .Tables("stenosis", &FlowSpec::stenosis, StenosisKeys(), 0,
                  "stenoses with a pressure loss by Young and Tsai")
          .Checked(Check)
          .Example(
              "inlet = \"aorta\"\n"
              "inlet_mL_s = 80\n"
              "rate_per_min = 72\n"
              "pulsatility = 1\n"
              "[[effects.flow.outlet]]\n"
              "centerline = \"aorta\"\n"
              "resistance_mmHg_s_mL = 1.2\n"
              "compliance_mL_mmHg = 1.4\n"
              "[[effects.flow.outlet]]\n"
              "centerline = \"lad\"\n"
              "resistance_mmHg_s_mL = 100\n"
              "systolic_mmHg = 120\n");
  return keys;
}

const char* NameOf(CurveEnd end) { return end == CurveEnd::kStart ? "start" : "end"; }

double RadiusAt(const FlowGraph& graph, int node) {
  return graph.network().At(graph.nodes()[static_cast<std::size_t>(node)].place).radius_mm;
}

// Node at a free end of a curve, which is an "inlet" or "outlet". Throws UserError naming `key`
// otherwise.
int FreeEnd(const TableSpec& spec, const char* key, const std::string& curve, CurveEnd end,
            const char* role, const FlowGraph& graph) {
  const std::string side = NameOf(end);
  int node = 0;
  try {
    node = graph.NodeAt(curve, side);
  } catch (const UserError& error) {
    spec.origin.Refuse(key, error.what());
  }
  if (!graph.nodes()[static_cast<std::size_t>(node)].is_end()) {
    spec.origin.Refuse(key, "its " + side + " is not an " + role +
                                ": it is joined to other curves; name a free end");
  }
  return node;
}

// All inlets: that of the effect's own keys, and those of the tables.
FlowInlet MakeInlet(const FlowSpec& spec, const FlowGraph& graph) {
  FlowInlet inlet{.node = FreeEnd(spec, "inlet", spec.inlet, spec.inlet_end, "inlet", graph),
                  .mL_s = spec.inlet_mL_s.value_or(0),
                  .mean_mmHg = spec.inlet_mean_mmHg,
                  .held_mmHg = spec.inlet_held_mmHg,
                  .resistance_mmHg_s_mL = spec.inlet_resistance_mmHg_s_mL};
  for (const InletSpec& other : spec.other_inlet) {
    const int node = FreeEnd(other, "centerline", other.centerline, other.end, "inlet", graph);
    bool is_named = node == inlet.node;
    for (const FlowSource& source : inlet.others) is_named = is_named || source.node == node;
    if (is_named) {
      other.origin.Refuse("centerline", "this inlet is named twice; remove one of the two");
    }
    inlet.others.push_back({node, other.mL_s});
  }
  return inlet;
}

bool IsInlet(const FlowInlet& inlet, int node) {
  const auto is_it = [node](const FlowSource& other) { return other.node == node; };
  return inlet.node == node || std::any_of(inlet.others.begin(), inlet.others.end(), is_it);
}

// Outlets named by tables, by node.
std::vector<FlowEnd> NamedOutlets(const FlowSpec& spec, const FlowGraph& graph,
                                  const FlowInlet& inlet) {
  std::vector<FlowEnd> named;
  for (const OutletSpec& outlet : spec.outlet) {
    FlowEnd end;
    end.node = FreeEnd(outlet, "centerline", outlet.centerline, outlet.end, "outlet", graph);
    if (IsInlet(inlet, end.node)) {
      outlet.origin.Refuse("centerline", std::string("its ") + NameOf(outlet.end) +
                                             " is not an outlet: it is an inlet; name a free end");
    }
    for (const FlowEnd& other : named) {
      if (other.node == end.node) {
        outlet.origin.Refuse("centerline",
                             "this outlet is named twice; remove one of the two tables");
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

// A connected part of the network.
struct Part {
  bool has_inlet = false;
  bool has_outlet = false;
  bool is_pressure = false;  // its inlet gives a pressure, so its flow is not known before
  double mL_s = 0;           // into its inlets
  double shares = 0;         // of its outlets by Murray's law
};

// The parts, by their numbers in `of_node`. Each has an inlet and an outlet; otherwise throws
// UserError.
std::vector<Part> MakeParts(const FlowSpec& spec, const FlowGraph& graph, const FlowInlet& inlet,
                            const std::vector<int>& of_node) {
  std::vector<Part> parts;
  for (std::size_t n = 0; n < of_node.size(); ++n) {
    const auto number = static_cast<std::size_t>(of_node[n]);
    if (number >= parts.size()) parts.resize(number + 1);
    Part& part = parts[number];
    const int node = static_cast<int>(n);
    if (!graph.nodes()[n].is_end()) continue;
    if (IsInlet(inlet, node)) {
      part.has_inlet = true;
      continue;
    }
    part.has_outlet = true;
    part.shares += std::pow(RadiusAt(graph, node), spec.murray_exponent);
  }
  const auto part_of = [&](int node) -> Part& {
    return parts[static_cast<std::size_t>(of_node[static_cast<std::size_t>(node)])];
  };
  part_of(inlet.node).mL_s += inlet.mL_s;
  part_of(inlet.node).is_pressure = !spec.inlet_mL_s;
  for (const FlowSource& other : inlet.others) part_of(other.node).mL_s += other.mL_s;
  for (std::size_t n = 0; n < of_node.size(); ++n) {
    const Part& part = parts[static_cast<std::size_t>(of_node[n])];
    const std::string name = graph.NameOf(static_cast<int>(n));
    if (!part.has_inlet) {
      spec.origin.Refuse(
          "inlet", "the outlet " + name +
                       " is not connected to the inlet; join the curves so that their ends "
                       "coincide, name an inlet of that part in [[effects.flow.other_inlet]], or "
                       "remove that curve");
    }
    if (!part.has_outlet) {
      spec.origin.Refuse("inlet", "there is no outlet: the part of the network with " + name +
                                      " has no other free end; add a centerline with a free end, "
                                      "or remove [effects.flow]");
    }
  }
  return parts;
}

// All free ends but the inlets: named ones from their tables, the others from the scene's general
// setting.
std::vector<FlowEnd> AllOutlets(const FlowSpec& spec, const FlowGraph& graph,
                                const FlowInlet& inlet) {
  std::vector<FlowEnd> ends = NamedOutlets(spec, graph, inlet);
  const std::size_t named = ends.size();
  const std::vector<int> of_node = graph.Parts();
  const std::vector<Part> parts = MakeParts(spec, graph, inlet, of_node);
  const auto is_murray = [&spec](const Part& part) {
    return spec.outlets == Outlets::kMurray ||
           (spec.outlets == Outlets::kAutomatic && !part.is_pressure);
  };
  double all_mL_s = 0;
  for (const Part& part : parts) all_mL_s += is_murray(part) ? part.mL_s : 0;
  for (std::size_t n = 0; n < graph.nodes().size(); ++n) {
    const int node = static_cast<int>(n);
    if (!graph.nodes()[n].is_end() || IsInlet(inlet, node)) continue;
    const auto is_it = [node](const FlowEnd& end) { return end.node == node; };
    const auto last = ends.begin() + static_cast<std::ptrdiff_t>(named);
    if (std::any_of(ends.begin(), last, is_it)) continue;
    const Part& part = parts[static_cast<std::size_t>(of_node[n])];
    const double share = std::pow(RadiusAt(graph, node), spec.murray_exponent) / part.shares;
    const bool murray = is_murray(part);
    ends.push_back({.node = node,
                    .is_pressure = !murray,
                    .pressure_mmHg = spec.outlet_mmHg,
                    .resistance_mmHg_s_mL = murray ? spec.bed_mmHg / (share * part.mL_s) : 0,
                    .compliance_mL_mmHg =
                        murray ? share * (part.mL_s / all_mL_s) * spec.compliance_mL_mmHg : 0});
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
                       "between from_mm and to_mm the lumen is nowhere narrower than at the wider "
                       "end; move both to the stenosis, or remove this table");
  }
  const auto area = [](double r_mm) { return std::numbers::pi * r_mm * r_mm; };
  return {.edge = graph.EdgeAt(network.Place(spec.centerline, throat_at_mm)),
          .loss_mmHg_s2_mL2 = StenosisLossMmHg(area(wide_mm), area(throat_mm)),
          .at_mm = throat_at_mm};
}

std::unique_ptr<Effect> MakeFlow(const FlowSpec& spec, const EffectContext& context) {
  if (context.centerlines == nullptr || context.centerlines->empty()) {
    spec.origin.Refuse("inlet",
                       "blood flow needs centerlines, and this vessel has none; give "
                       "vessel.centerlines, or remove [effects.flow]");
  }
  std::unique_ptr<const FlowGraph> graph;
  try {
    graph = std::make_unique<FlowGraph>(*context.centerlines);
  } catch (const UserError& error) {
    spec.origin.Refuse("inlet", error.what());
  }
  const FlowInlet inlet = MakeInlet(spec, *graph);
  std::vector<FlowEnd> outlets = AllOutlets(spec, *graph, inlet);
  std::vector<StenosisLoss> stenoses;
  for (const StenosisSpec& stenosis : spec.stenosis) {
    stenoses.push_back(MakeStenosis(stenosis, *graph));
  }
  Obstruction obstruction;
  if (spec.obstruction) obstruction = {&context.wire, context.moving};
  const Pulse pulse{spec.rate_per_min,
                    spec.pulsatility.value_or(spec.inlet_held_mmHg ? 0 : kPulsatility)};
  return std::make_unique<Flow>(std::move(graph), 1e-3 * spec.viscosity_mPa_s, inlet,
                                std::move(outlets), pulse, std::move(stenoses), obstruction);
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
