#include "host/simulator/effects/blood/flow.h"

#include <catch2/catch.hpp>
#include <cmath>
#include <numbers>

#include "tests/effects/vascular_scene.h"
#include "tests/support/paths.h"

using Catch::Contains;
using torquer::effects::Flow;
using torquer::effects::FlowEdge;
using torquer::effects::FlowGraph;
using torquer::effects::FlowNode;
using torquer::effects::FlowSolution;
using torquer::effects::Pulse;
using torquer::test::kFork;
using torquer::test::kStraight;
using torquer::test::Refusal;
using torquer::test::SceneOf;
using torquer::vessel::Centerline;
using torquer::vessel::CenterlineNetwork;

namespace {

// Largest flow imbalance of a joint, mL/s.
double WorstImbalance(const FlowGraph& graph, const FlowSolution::Flows& flows, int inlet) {
  double worst = 0;
  for (std::size_t n = 0; n < graph.nodes().size(); ++n) {
    if (graph.nodes()[n].is_end() || static_cast<int>(n) == inlet) continue;
    double sum = 0;
    for (const int e : graph.nodes()[n].edges) {
      const FlowEdge& edge = graph.edges()[static_cast<std::size_t>(e)];
      const double flow = flows.edge_mL_s[static_cast<std::size_t>(e)];
      sum += edge.b == static_cast<int>(n) ? flow : -flow;
    }
    worst = std::max(worst, std::abs(sum));
  }
  return worst;
}

double Outflow(const FlowSolution::Flows& flows) {
  double sum = 0;
  for (const double end : flows.end_mL_s) sum += end;
  return sum;
}

const std::string kInlet = "[effects.flow]\ninlet = \"stem\"\ninlet_mL_s = 5\n";

}  // namespace

TEST_CASE("A symmetric fork splits the flow evenly", "[effects]") {
  SceneOf scene(kFork + kInlet);
  const Flow& flow = scene.Get<Flow>();
  REQUIRE(flow.graph().edges().size() == 3);
  REQUIRE(flow.graph().nodes().size() == 4);
  for (const FlowEdge& edge : flow.graph().edges()) {
    const bool stem = flow.graph().network().curves()[edge.curve].name() == "stem";
    const auto e = static_cast<std::size_t>(&edge - flow.graph().edges().data());
    CHECK(flow.mean().edge_mL_s[e] == Approx(stem ? 5 : 2.5).epsilon(1e-12));
  }
}

TEST_CASE("The pressure loss in a stenosis is that of Poiseuille", "[effects]") {
  // Radius 2 mm, but 1 mm from 90 to 110 mm, with cones of 10 mm on both sides.
  std::vector<Eigen::Vector3d> points;
  std::vector<double> radii;
  for (const auto& [x, r] : std::vector<std::pair<double, double>>{
           {0, 2}, {80, 2}, {90, 1}, {110, 1}, {120, 2}, {200, 2}}) {
    points.emplace_back(x, 0, 0);
    radii.push_back(r);
  }
  const CenterlineNetwork network({Centerline("tube", points, radii)});
  auto graph = std::make_unique<FlowGraph>(network);
  const int inlet = graph->NodeAt("tube", "start");
  const int outlet = graph->NodeAt("tube", "end");
  const Flow flow(std::move(graph), 3.5e-3, {.node = inlet, .mL_s = 4}, {{outlet, true, 60, 0}},
                  {});
  // 8 mu Q / pi [160/2^4 + 20/1^4 + 2 int_0^10 ds/(1 + s/10)^4]; the last term is 2*10*7/24.
  const double integral_1_mm3 = 160.0 / 16 + 20 + 2 * 10 * 7.0 / 24;
  const double drop_Pa = 8 * 3.5e-3 * 4e3 / std::numbers::pi * integral_1_mm3;
  const double drop_mmHg = flow.mean().pressure_mmHg[static_cast<std::size_t>(inlet)] -
                           flow.mean().pressure_mmHg[static_cast<std::size_t>(outlet)];
  CHECK(flow.mean().pressure_mmHg[static_cast<std::size_t>(outlet)] == 60);
  CHECK(drop_mmHg * 133.322387415 == Approx(drop_Pa).epsilon(1e-10));
}

TEST_CASE("Pressures at both ends drive the flow of Poiseuille", "[effects]") {
  const std::string key = GENERATE("inlet_mean_mmHg", "inlet_held_mmHg");
  SceneOf scene(kStraight + "[effects.flow]\ninlet = \"tube\"\n" + key +
                " = 11\noutlet_mmHg = 10\n");
  const Flow& flow = scene.Get<Flow>();
  const double expected_mL_s = 1e-3 * 133.322387415 * std::numbers::pi * 16 / (8 * 3.5e-3 * 200);
  CHECK(flow.mean().edge_mL_s[0] == Approx(expected_mL_s).epsilon(1e-6));
}

TEST_CASE("Outlets of given resistance and pressure share the flow accordingly", "[effects]") {
  SceneOf scene(kFork + kInlet +
                "[[effects.flow.outlet]]\ncenterline = \"left\"\nresistance_mmHg_s_mL = 30\n"
                "[[effects.flow.outlet]]\ncenterline = \"right\"\nresistance_mmHg_s_mL = 10\n"
                "pressure_mmHg = 5\n");
  const Flow& flow = scene.Get<Flow>();
  const auto& ends = flow.solution().ends();
  REQUIRE(ends.size() == 2);
  const double r = flow.solution().resistance_mmHg_s_mL()[1];
  // Pressure p at the fork: (p - 0)/(r + 30) + (p - 5)/(r + 10) = 5.
  const double p = (5 + 5 / (r + 10)) / (1 / (r + 30) + 1 / (r + 10));
  CHECK(flow.mean().end_mL_s[0] == Approx(p / (r + 30)).epsilon(1e-9));
  CHECK(flow.mean().end_mL_s[1] == Approx((p - 5) / (r + 10)).epsilon(1e-9));
}

TEST_CASE("By Murray's law outlets take flow as the cube of their radius", "[effects]") {
  std::string text = kFork;
  text.replace(text.rfind("radii_mm = [3]"), 14, "radii_mm = [1.5]");
  SceneOf scene(text + kInlet);
  const Flow& flow = scene.Get<Flow>();
  // The branches' own resistance is small compared with that of the vascular beds.
  CHECK(flow.mean().end_mL_s[0] / flow.mean().end_mL_s[1] == Approx(8).epsilon(0.05));
}

TEST_CASE("Every joint of a patient's arteries conserves blood to rounding", "[effects]") {
  const CenterlineNetwork network =
      torquer::vessel::ParseSlicerCurves(torquer::vessel::ReadCurveFiles(
          torquer::test::SourcePath("/host/scenes/meshes/neuro_arch/centerlines")));
  auto graph = std::make_unique<FlowGraph>(network);
  // 25 curves, two of which branch midway. Both vertebral arteries meet, so there is one ring. The
  // stump of the aortic root and 13 outlets are free.
  const int inlet = graph->NodeAt("curve_00", "start");
  int free = 0;
  for (const FlowNode& node : graph->nodes()) free += node.is_end();
  CHECK(free == 14);
  CHECK(graph->edges().size() == 27);
  CHECK(graph->nodes().size() == 27);
  std::vector<torquer::effects::FlowEnd> ends;
  for (std::size_t n = 0; n < graph->nodes().size(); ++n) {
    if (!graph->nodes()[n].is_end() || static_cast<int>(n) == inlet) continue;
    ends.push_back({static_cast<int>(n), n % 2 == 0, 80, 20});
  }
  for (const bool reached : graph->ReachedFrom(inlet)) CHECK(reached);
  const Flow flow(std::move(graph), 3.5e-3, {.node = inlet, .mL_s = 80}, ends, {});
  CHECK(WorstImbalance(flow.graph(), flow.mean(), inlet) < 80 * 1e-14);
  CHECK(Outflow(flow.mean()) == Approx(80).epsilon(1e-14));
}

TEST_CASE("The pulse keeps the mean flow and never turns it", "[effects]") {
  const Pulse pulse{72, 0.8};
  double sum = 0;
  double lowest = 10;
  double highest = 0;
  constexpr int kSteps = 10000;
  for (int k = 0; k < kSteps; ++k) {
    const double factor = pulse.At(60.0 / 72 * (k + 0.5) / kSteps);
    sum += factor;
    lowest = std::min(lowest, factor);
    highest = std::max(highest, factor);
  }
  CHECK(sum / kSteps == Approx(1).epsilon(1e-6));
  CHECK(lowest == Approx(0.2));
  CHECK(highest == Approx(0.2 + 0.8 * 2 / 0.35).epsilon(1e-5));
  CHECK(Pulse{}.At(0.3) == 1);
}

TEST_CASE("Flow that cannot be is refused with key, value and remedy", "[effects]") {
  CHECK_THAT(Refusal(kFork + "[effects.flow]\ninlet = \"stam\"\ninlet_mL_s = 5\n"),
             Contains("test.toml:") && Contains("inlet = 'stam'") && Contains("stem"));
  CHECK_THAT(Refusal(kFork + "[effects.flow]\ninlet = \"left\"\ninlet_mL_s = 5\n"),
             Contains("joined to other curves"));
  CHECK_THAT(Refusal(kFork + "[effects.flow]\ninlet = \"stem\"\n"), Contains("inlet_mean_mmHg"));
  CHECK_THAT(Refusal(kFork + "[effects.flow]\ninlet = \"stem\"\ninlet_mL_s = -1\n"),
             Contains("inlet_mL_s = -1"));
  CHECK_THAT(Refusal(kFork + kInlet + "viscosity_mPa_s = nan\n"), Contains("viscosity_mPa_s"));
  CHECK_THAT(Refusal(kFork + kInlet +
                     "[[effects.flow.outlet]]\ncenterline = \"stem\"\n"
                     "pressure_mmHg = 5\n"),
             Contains("not an outlet"));
  CHECK_THAT(Refusal(kFork + kInlet + "[[effects.flow.outlet]]\ncenterline = \"left\"\n"),
             Contains("pressure_mmHg: is missing"));
  CHECK_THAT(Refusal(kFork + "[effects.flow]\ninlet = \"stem\"\ninlet_mean_mmHg = 5\n"
                             "outlets = \"murray\"\n"),
             Contains("needs inlet_mL_s"));
  // Moves the end of the right branch elsewhere.
  std::string apart = kFork;
  apart.replace(apart.rfind("[[100, 0, 0]"), 12, "[[150, 0, 0]");
  CHECK_THAT(Refusal(apart + kInlet),
             Contains("outlet \"right\"") && Contains("not connected") && Contains("join"));
}
