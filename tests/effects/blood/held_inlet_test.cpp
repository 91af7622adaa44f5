// Inlet of given pressure, from a source that holds it. It is compared with circuits solved by
// hand, and with a flow source of that mean pressure.
#include <catch2/catch.hpp>
#include <cmath>
#include <numbers>

#include "host/simulator/effects/blood/contrast.h"
#include "host/simulator/effects/blood/flow.h"
#include "tests/effects/vascular_scene.h"
#include "tests/support/wires.h"

using Catch::Contains;
using torquer::effects::Contrast;
using torquer::effects::ContrastSettings;
using torquer::effects::Flow;
using torquer::test::kFork;
using torquer::test::Refusal;
using torquer::test::SceneOf;

namespace {

// Resistance, mmHg s/mL, of a tube of kFork: 8 mu L/(pi r^4) in SI units, with r = 3 mm.
double TubeMmHgSPerML(double length_mm) {
  const double pa_s_m3 = 8 * 3.5e-3 * 1e-3 * length_mm / (std::numbers::pi * std::pow(3e-3, 4));
  return pa_s_m3 * 1e-6 / 133.322387415;
}

constexpr double kStemMm = 100;
const double kBranchMm = std::hypot(80, 40);
constexpr double kHeldMmHg = 90;

// Two outlets of 30 and 10 mmHg s/mL; behind the second one is a pressure of 5 mmHg.
const std::string kOutlets =
    "[[effects.flow.outlet]]\ncenterline = \"left\"\nresistance_mmHg_s_mL = 30\n"
    "[[effects.flow.outlet]]\ncenterline = \"right\"\nresistance_mmHg_s_mL = 10\n"
    "pressure_mmHg = 5\n";

std::string Inlet(const std::string& keys) {
  return "[effects.flow]\ninlet = \"stem\"\n" + keys + "\n";
}

// Circuit of the fork with a source of kHeldMmHg behind a resistance.
struct Circuit {
  explicit Circuit(double source_mmHg_s_mL) : source(source_mmHg_s_mL) {}
  double left = TubeMmHgSPerML(kBranchMm) + 30, right = TubeMmHgSPerML(kBranchMm) + 10;
  double source;

  double Inflow(double held_mmHg = kHeldMmHg) const {
    const double stem = source + TubeMmHgSPerML(kStemMm);
    // Pressure p at the fork: (held - p)/stem = p/left + (p - 5)/right.
    const double p = (held_mmHg / stem + 5 / right) / (1 / stem + 1 / left + 1 / right);
    return (held_mmHg - p) / stem;
  }
  // Decrease of the inflow by a unit of injection at a place of the stem. The injected flow divides
  // between the way back to the source and the way to the outlets.
  double Reduction(double at_mm) const {
    const double back = source + TubeMmHgSPerML(at_mm);
    const double on = TubeMmHgSPerML(kStemMm - at_mm) + 1 / (1 / left + 1 / right);
    return on / (back + on);
  }
};

// Inflow at the inlet, mL/s, at a time.
double InflowAt(const Flow& flow, double time_s) {
  std::vector<double> edges;
  flow.EdgesAt(time_s, edges);
  const auto inlet = static_cast<std::size_t>(flow.inlet());
  return edges[static_cast<std::size_t>(flow.graph().nodes()[inlet].edges.front())];
}

// Concentration in a branch after a long injection of 4 mL/s with 300 mg/mL into the stem. Dye and
// blood mix, so it is the branch's flow over the whole flow.
constexpr double kInjectedML_s = 4;
constexpr double kInjectedAtMm = 40;
double DilutedTo(const Flow& flow) {
  const auto stem = flow.graph().network().Place("stem", kInjectedAtMm);
  const ContrastSettings settings{.site = ContrastSettings::Site::kPlace,
                                  .place = stem,
                                  .rate_mL_s = kInjectedML_s,
                                  .concentration_mg_mL = 300,
                                  .dispersion_mm2_s = 0,
                                  .cell_mm = 2};
  const torquer::WireModel wire = torquer::test::MakeWire({});
  Contrast contrast(flow, settings, wire);
  for (int k = 1; k <= 800; ++k) {
    contrast.Advance(0.01 * k, 0.01, true, Eigen::Vector3d::Zero());
  }
  const auto left = flow.graph().network().Place("left", 40.0);
  const auto& cells = contrast.cells()[static_cast<std::size_t>(flow.graph().EdgeAt(left))];
  return contrast.concentration_mg_mL()[cells.first + cells.count / 2] / 300;
}

}  // namespace

TEST_CASE("An injection pushes back the inflow from a source that holds its pressure",
          "[effects]") {
  for (const double source : {0.0, 2.0}) {
    INFO(source);
    SceneOf scene(
        kFork +
        Inlet("inlet_held_mmHg = 90\ninlet_resistance_mmHg_s_mL = " + std::to_string(source)) +
        kOutlets);
    const Flow& flow = scene.Get<Flow>();
    const Circuit circuit(source);
    CHECK(InflowAt(flow, 0) == Approx(circuit.Inflow()).epsilon(1e-9));
    const double inflow = circuit.Inflow() - kInjectedML_s * circuit.Reduction(kInjectedAtMm);
    CHECK(DilutedTo(flow) == Approx(kInjectedML_s / (inflow + kInjectedML_s)).epsilon(1e-6));
    CHECK(inflow < circuit.Inflow() - 3);
  }
}

TEST_CASE("An injection does not change the inflow of a flow source, for any source of its mean",
          "[effects]") {
  const Circuit circuit(0);
  const std::string given = GENERATE_COPY(std::string("inlet_mean_mmHg = 90"),
                                          "inlet_mL_s = " + std::to_string(circuit.Inflow()));
  SceneOf scene(kFork + Inlet(given) + kOutlets);
  const Flow& flow = scene.Get<Flow>();
  CHECK(InflowAt(flow, 0) == Approx(circuit.Inflow()).epsilon(1e-6));
  CHECK(DilutedTo(flow) ==
        Approx(kInjectedML_s / (circuit.Inflow() + kInjectedML_s)).epsilon(1e-6));
}

TEST_CASE("A held pressure is steady unless a pulsatility is given", "[effects]") {
  const Circuit circuit(2);
  const std::string held =
      "inlet_held_mmHg = 90\ninlet_resistance_mmHg_s_mL = 2\nrate_per_min = 60\n";
  {
    SceneOf scene(kFork + Inlet(held) + kOutlets);
    for (const double time_s : {0.1, 0.175, 0.7}) {
      CHECK(InflowAt(scene.Get<Flow>(), time_s) == Approx(circuit.Inflow()).epsilon(1e-9));
    }
  }
  // A Windkessel so small that it takes no flow makes the flow advance in steps.
  for (const char* more : {"", "compliance_mL_mmHg = 1e-12\n"}) {
    INFO(more);
    SceneOf scene(kFork + Inlet(held + "pulsatility = 0.2") + kOutlets + more);
    Flow& flow = scene.Get<Flow>();
    // 80 % of the pressure in diastole; at the peak of the ejection 0.2 times 2/0.35 more.
    flow.AdvanceTo(0.176);
    const double peak = 0.8 + 0.2 * 2 / 0.35;
    CHECK(InflowAt(flow, 0.175) == Approx(circuit.Inflow(peak * kHeldMmHg)).epsilon(1e-3));
    flow.AdvanceTo(0.7);
    CHECK(InflowAt(flow, 0.7) == Approx(circuit.Inflow(0.8 * kHeldMmHg)).epsilon(1e-6));
  }
}

TEST_CASE("An inlet that is several sources, or none, is refused with key and remedy",
          "[effects]") {
  for (const char* keys :
       {"", "inlet_mL_s = 5\ninlet_held_mmHg = 90", "inlet_mean_mmHg = 90\ninlet_held_mmHg = 90"}) {
    INFO(keys);
    CHECK_THAT(Refusal(kFork + Inlet(keys)),
               Contains("test.toml:") && Contains("exactly one of inlet_mL_s") &&
                   Contains("inlet_mean_mmHg") && Contains("inlet_held_mmHg"));
  }
  CHECK_THAT(Refusal(kFork + Inlet("inlet_mean_mmHg = 90\ninlet_resistance_mmHg_s_mL = 2")),
             Contains("inlet_resistance_mmHg_s_mL = 2") && Contains("give inlet_held_mmHg"));
  CHECK_THAT(Refusal(kFork + Inlet("inlet_held_mmHg = 90\noutlets = \"murray\"")),
             Contains("needs inlet_mL_s"));
  // The old name of the key.
  CHECK_THAT(Refusal(kFork + Inlet("inlet_mmHg = 90")), Contains("inlet_mean_mmHg"));
}
