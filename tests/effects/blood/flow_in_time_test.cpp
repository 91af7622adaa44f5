// Flow that changes within a heartbeat, compared with closed forms.
#include <catch2/catch.hpp>
#include <cmath>
#include <numbers>

#include "host/simulator/effects/blood/flow.h"
#include "host/simulator/simulation.h"
#include "tests/effects/vascular_scene.h"

using Catch::Contains;
using torquer::effects::AnnulusInverseFourthPower;
using torquer::effects::Flow;
using torquer::effects::FlowEnd;
using torquer::effects::FlowGraph;
using torquer::effects::PoiseuilleMmHgSPerML;
using torquer::effects::Pulse;
using torquer::simulator::Command;
using torquer::simulator::Simulation;
using torquer::test::kFork;
using torquer::test::kStraight;
using torquer::test::Refusal;
using torquer::test::SceneOf;
using torquer::vessel::Centerline;
using torquer::vessel::CenterlineNetwork;

namespace {

constexpr double kViscosity_Pa_s = 3.5e-3;

std::size_t At(int index) { return static_cast<std::size_t>(index); }

// A tube of 200 mm length and 2 mm radius with one outlet.
struct Tube {
  Flow Make(FlowEnd out, double inlet_mL_s, const Pulse& pulse) const {
    auto graph = std::make_unique<FlowGraph>(network);
    const int inlet = graph->NodeAt("tube", "start");
    out.node = graph->NodeAt("tube", "end");
    return Flow(std::move(graph), kViscosity_Pa_s, {.node = inlet, .mL_s = inlet_mL_s}, {out},
                pulse);
  }
  CenterlineNetwork network{{Centerline("tube", {{0, 0, 0}, {200, 0, 0}}, {2, 2})}};
};

double OutletPressure(const Flow& flow) {
  return flow.now().pressure_mmHg[At(flow.solution().ends()[0].node)];
}

}  // namespace

TEST_CASE("Outlets at different pressures exchange blood in diastole", "[effects]") {
  SceneOf scene(kFork +
                "[effects.flow]\ninlet = \"stem\"\ninlet_mL_s = 5\nrate_per_min = 60\n"
                "pulsatility = 1\n"
                "[[effects.flow.outlet]]\ncenterline = \"left\"\npressure_mmHg = 80\n"
                "[[effects.flow.outlet]]\ncenterline = \"right\"\npressure_mmHg = 60\n");
  const Flow& flow = scene.Get<Flow>();
  std::vector<double> diastole;
  flow.EdgesAt(0.7, diastole);
  std::vector<double> systole;
  flow.EdgesAt(0.175, systole);
  const double branch = flow.solution().resistance_mmHg_s_mL()[1];
  const double exchanged_mL_s = 20 / (2 * branch);
  // Peak inflow during ejection: 5 mL/s times 2/0.35, which keeps the mean at 5 mL/s.
  const double ejected_mL_s = 5 * 2 / 0.35;
  for (std::size_t e = 0; e < 3; ++e) {
    const std::string& name = flow.graph().network().curves()[flow.graph().edges()[e].curve].name();
    INFO(name);
    const double sign = name == "stem" ? 0 : name == "left" ? -1 : 1;
    CHECK(diastole[e] == Approx(sign * exchanged_mL_s).epsilon(1e-6).margin(1e-9));
    CHECK(systole[e] ==
          Approx(sign * exchanged_mL_s + (sign == 0 ? 1 : 0.5) * ejected_mL_s).epsilon(1e-6));
  }
}

TEST_CASE("A Windkessel empties exponentially through its resistance", "[effects]") {
  const Tube tube;
  for (const double proximal : {0.0, 0.1}) {
    for (const double compliance : {0.3, 1.5}) {
      INFO(proximal << " " << compliance);
      Flow flow = tube.Make({.pressure_mmHg = 5,
                             .resistance_mmHg_s_mL = 1.1,
                             .compliance_mL_mmHg = compliance,
                             .proximal_mmHg_s_mL = proximal},
                            80, {60, 1});
      flow.AdvanceTo(10.4);
      const double early = OutletPressure(flow) - 5;
      flow.AdvanceTo(10.9);
      // In diastole there is no inflow, so none through the proximal resistance either.
      const double decay = std::exp(-0.5 / (1.1 * compliance));
      CHECK((OutletPressure(flow) - 5) / early == Approx(decay).epsilon(0.005));
      // Inflow equals outflow: the mean over a beat, once the flow is periodic.
      double mean = 0;
      for (int k = 1; k <= 500; ++k) {
        flow.AdvanceTo(15 + 2e-3 * k);
        mean += OutletPressure(flow) / 500;
      }
      CHECK(mean == Approx(5 + 80 * (1.1 + proximal)).epsilon(0.003));
    }
  }
}

TEST_CASE("A stiff or a large Windkessel stays stable in its steps", "[effects]") {
  const Tube tube;
  for (const double compliance : {1e-9, 1e-3, 100.0}) {
    INFO(compliance);
    Flow flow =
        tube.Make({.resistance_mmHg_s_mL = 1, .compliance_mL_mmHg = compliance}, 80, {60, 1});
    double highest = 0;
    double lowest = 1e9;
    for (int k = 1; k <= 2000; ++k) {
      flow.AdvanceTo(2e-3 * k);
      highest = std::max(highest, OutletPressure(flow));
      lowest = std::min(lowest, OutletPressure(flow));
    }
    CHECK(highest <= 80 * 2 / 0.35 * (1 + 1e-9));
    CHECK(lowest >= -1e-9);
    if (compliance < 1e-6) CHECK(lowest == Approx(0).margin(1e-6));
    if (compliance == 100) CHECK(highest - lowest < 2);
  }
}

TEST_CASE("The heart's muscle makes the flow of a coronary outlet diastolic", "[effects]") {
  SceneOf scene(kFork +
                "[effects.flow]\ninlet = \"stem\"\ninlet_mL_s = 5\nrate_per_min = 60\n"
                "pulsatility = 0\n"
                "[[effects.flow.outlet]]\ncenterline = \"left\"\nresistance_mmHg_s_mL = 20\n"
                "[[effects.flow.outlet]]\ncenterline = \"right\"\nresistance_mmHg_s_mL = 60\n"
                "systolic_mmHg = 50\n");
  const Flow& flow = scene.Get<Flow>();
  const double r = flow.solution().resistance_mmHg_s_mL()[1];
  std::size_t right = 0;
  while (flow.graph().network().curves()[flow.graph().edges()[right].curve].name() != "right") {
    ++right;
  }
  const auto expected = [&](double behind_mmHg) {
    // Pressure p at the fork: p/(r + 20) + (p - behind)/(r + 60) = 5.
    const double p = (5 + behind_mmHg / (r + 60)) / (1 / (r + 20) + 1 / (r + 60));
    return (p - behind_mmHg) / (r + 60);
  };
  std::vector<double> edges;
  flow.EdgesAt(0.175, edges);
  CHECK(edges[right] == Approx(expected(50)).epsilon(1e-9));
  flow.EdgesAt(0.7, edges);
  CHECK(edges[right] == Approx(expected(0)).epsilon(1e-9));
  CHECK(expected(0) > 1.9 * expected(50));
}

TEST_CASE("A cylinder in the middle of a tube leaves the flow of an annulus", "[effects]") {
  // Independent profile: (s u')' = -s between walls, u = 0 there, shooting for u'.
  const double r = 2;
  for (const double a : {0.178, 0.4445, 1.0, 1.8}) {
    INFO(a);
    constexpr int kSteps = 20000;
    const double h = (r - a) / kSteps;
    const auto shoot = [&](double slope, double& flow) {
      // s u' = a slope - (s^2 - a^2)/2.
      double u = 0;
      flow = 0;
      for (int k = 0; k < kSteps; ++k) {
        const double s = a + (k + 0.5) * h;
        const double du = (a * slope - (s * s - a * a) / 2) / s;
        flow += 2 * std::numbers::pi * s * (u + du * h / 2) * h;
        u += du * h;
      }
      return u;
    };
    double flow = 0;
    const double at_0 = shoot(0, flow);
    const double at_1 = shoot(1, flow);
    CHECK(shoot(at_0 / (at_0 - at_1), flow) == Approx(0).margin(1e-9));
    // In these units an open tube carries pi r^4/8.
    CHECK(AnnulusInverseFourthPower(r, a) == Approx(std::numbers::pi / 8 / flow).epsilon(1e-5));
  }
  CHECK(AnnulusInverseFourthPower(r, 0) == Approx(1 / 16.0));
}

TEST_CASE("A wire in a vessel obstructs as far as it lies in it", "[effects]") {
  for (const bool obstructs : {true, false}) {
    SceneOf scene(kStraight + "[effects.flow]\ninlet = \"tube\"\ninlet_mL_s = 4\n" +
                  "outlets = \"pressure\"\noutlet_mmHg = 10\n" +
                  (obstructs ? "obstruction = true\n" : ""));
    Simulation session(*scene);
    const Flow& flow = scene.Get<Flow>();
    Command command;
    command.time_s = 0;
    for (const double insertion_mm : {40.0, 90.0}) {
      command.target[0].insertion_mm = insertion_mm;
      for (int k = 1; k <= 3; ++k) {
        command.time_s += 0.1;
        torquer::CountedBudget budget(2000);
        session.Tick(command, budget);
      }
      const double lies_mm = obstructs ? insertion_mm : 0;
      const double drop_mmHg =
          4 *
          PoiseuilleMmHgSPerML(kViscosity_Pa_s,
                               (200 - lies_mm) / 16 + lies_mm * AnnulusInverseFourthPower(2, 0.3));
      const FlowGraph& graph = flow.graph();
      const double found = flow.mean().pressure_mmHg[At(graph.NodeAt("tube", "start"))] - 10;
      CHECK(found == Approx(drop_mmHg).epsilon(0.002));
    }
  }
}

TEST_CASE("The pressure loss behind a stenosis is that of Young and Tsai", "[effects]") {
  // The radius narrows from 2 to 1 mm and widens again. Closed form: R q + k q^2 = 30 mmHg.
  const std::string tube =
      "[vessel]\nkind = \"tubes\"\nwall_stiffness_N_mm2 = 1\n[[vessel.tube]]\nname = \"tube\"\n"
      "points_mm = [[0, 0, 0], [80, 0, 0], [90, 0, 0], [110, 0, 0], [120, 0, 0], [200, 0, 0]]\n"
      "radii_mm = [2, 2, 1, 1, 2, 2]\n[entry]\ncenterline = \"tube\"\nat_mm = 1\n"
      "[[instrument]]\nmax_length_mm = 150\nradius_mm = 0.3\nrigidity_N_mm2 = 1\n"
      "[effects.flow]\ninlet = \"tube\"\n";
  const std::string stenosis =
      "[[effects.flow.stenosis]]\ncenterline = \"tube\"\nfrom_mm = 75\nto_mm = 125\n";
  const double area_m2 = std::numbers::pi * 4e-6;
  const double k = 1.52 * 1060 / 2 * 9 / (area_m2 * area_m2) * 1e-12 / 133.322387415;
  {
    SceneOf scene(tube + "inlet_mean_mmHg = 40\noutlet_mmHg = 10\n" + stenosis);
    const Flow& flow = scene.Get<Flow>();
    const double r =
        PoiseuilleMmHgSPerML(kViscosity_Pa_s, flow.graph().InverseFourthPower(0, 0, 200));
    const double expected = (std::sqrt(r * r + 4 * k * 30) - r) / (2 * k);
    CHECK(flow.mean().edge_mL_s[0] == Approx(expected).epsilon(1e-4));
    CHECK(expected < 0.8 * 30 / r);
  }
  {
    // Pulsatile flow satisfies the same equation at every moment.
    SceneOf scene(tube + "inlet_mL_s = 4\noutlets = \"pressure\"\nrate_per_min = 60\n" + stenosis);
    auto& flow = scene.Get<Flow>();
    const double r =
        PoiseuilleMmHgSPerML(kViscosity_Pa_s, flow.graph().InverseFourthPower(0, 0, 200));
    for (const double time_s : {0.1, 0.174, 0.3, 0.7, 1.174}) {
      flow.AdvanceTo(time_s);
      const double q = 4 * flow.pulse().At(time_s);
      const double found = flow.now().pressure_mmHg[At(flow.graph().NodeAt("tube", "start"))];
      CHECK(found == Approx(r * q + k * q * q).epsilon(1e-4));
      std::vector<double> edges;
      flow.EdgesAt(time_s, edges);
      CHECK(edges[0] == Approx(q).epsilon(1e-9));
    }
  }
}

TEST_CASE("A flow in time that cannot be is refused with key, value and remedy", "[effects]") {
  const std::string flow = "[effects.flow]\ninlet = \"tube\"\ninlet_mL_s = 5\n";
  CHECK_THAT(Refusal(kStraight + flow +
                     "[[effects.flow.outlet]]\ncenterline = \"tube\"\npressure_mmHg = 5\n"
                     "compliance_mL_mmHg = 1\n"),
             Contains("compliance_mL_mmHg = 1") && Contains("needs resistance_mmHg_s_mL"));
  CHECK_THAT(
      Refusal(kStraight + flow +
              "[[effects.flow.stenosis]]\ncenterline = \"tube\"\nfrom_mm = 10\nto_mm = 50\n"),
      Contains("from_mm = 10") && Contains("nowhere narrower"));
  CHECK_THAT(
      Refusal(kStraight + flow +
              "[[effects.flow.stenosis]]\ncenterline = \"tibe\"\nfrom_mm = 10\nto_mm = 50\n"),
      Contains("centerline = 'tibe'") && Contains("tube"));
}
