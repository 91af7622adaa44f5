// Blood flow of the shipped coronary scenes over a heartbeat, compared with the literature.
#include <catch2/catch.hpp>
#include <filesystem>
#include <map>

#include "host/simulator/effects/blood/flow.h"
#include "host/simulator/scene/scene.h"
#include "tests/support/paths.h"

using torquer::effects::Flow;
using torquer::effects::FlowEdge;

namespace {

constexpr double kEjection = 0.35;  // fraction of a cycle

const Flow* FlowOf(const torquer::scene::Scene& scene) {
  for (const auto& effect : scene.effects()) {
    if (const auto* flow = dynamic_cast<const Flow*>(effect.get())) return flow;
  }
  return nullptr;
}

// Mean flow, mL/s, from the start of each curve, and mean pressure in the aorta, over one beat.
struct Beat {
  std::map<std::string, double> systole, diastole, whole;
  double mean_mmHg = 0, lowest_mmHg = 1e9, highest_mmHg = 0;
};

Beat MeanOfBeat(Flow& flow) {
  constexpr int kSteps = 400;
  constexpr int kFirstBeat = 12;  // several times the emptying of the aorta
  const double beat_s = 60 / flow.pulse().per_minute;
  const auto root = static_cast<std::size_t>(flow.inlet());
  Beat beat;
  std::vector<double> edge_mL_s;
  for (int k = 0; k < kSteps; ++k) {
    const double phase = (k + 0.5) / kSteps;
    const double time_s = (kFirstBeat + phase) * beat_s;
    flow.AdvanceTo(time_s);
    flow.EdgesAt(time_s, edge_mL_s);
    for (std::size_t e = 0; e < flow.graph().edges().size(); ++e) {
      const FlowEdge& edge = flow.graph().edges()[e];
      if (edge.from_mm > 0.01) continue;
      const std::string& name = flow.graph().network().curves()[edge.curve].name();
      const double flow_mL_s = edge_mL_s[e] / kSteps;
      beat.whole[name] += flow_mL_s;
      if (phase < kEjection) beat.systole[name] += flow_mL_s / kEjection;
      if (phase >= kEjection) beat.diastole[name] += flow_mL_s / (1 - kEjection);
    }
    const double pressure = flow.now().pressure_mmHg[root];
    beat.mean_mmHg += pressure / kSteps;
    beat.lowest_mmHg = std::min(beat.lowest_mmHg, pressure);
    beat.highest_mmHg = std::max(beat.highest_mmHg, pressure);
  }
  return beat;
}

}  // namespace

// Diastole over systole in patients: 1.79 (SD 0.48) in the left main artery, 1.00 (0.32) in the
// right one. Source: Hadjiloizou et al., Am J Physiol Heart 2008;295:H1198. Others found 1.85
// (0.70) and 1.53 (0.34) (Seligman et al., EuroIntervention 2022;17:e1463). The heart's own vessels
// take 4 to 5 % of the cardiac output.
TEST_CASE("Shipped coronary scenes fill the left coronary artery in diastole", "[effects]") {
  const std::string folder = torquer::test::SourcePath("/host/scenes/");
  for (const char* name : {"coronary", "everything"}) {
    INFO(name);
    const torquer::scene::Scene scene(folder + name + ".toml");
    const Flow* found = FlowOf(scene);
    REQUIRE(found != nullptr);
    Flow& flow = const_cast<Flow&>(*found);
    const Beat beat = MeanOfBeat(flow);
    const auto ratio = [&](const char* curve) {
      return beat.diastole.at(curve) / beat.systole.at(curve);
    };
    for (const char* left : {"left_main", "lad", "diagonal_1", "circumflex", "marginal_1"}) {
      INFO(left);
      CHECK(ratio(left) > 1.2);
      CHECK(ratio(left) < 3);
    }
    for (const char* right : {"right", "right_marginal", "posterior_descending"}) {
      INFO(right);
      CHECK(ratio(right) > 0.7);
      CHECK(ratio(right) < 1.9);
      CHECK(ratio(right) < ratio("left_main"));
    }
    const double coronary_mL_s = beat.whole.at("left_main") + beat.whole.at("right");
    CHECK(coronary_mL_s > 0.03 * 80);
    CHECK(coronary_mL_s < 0.06 * 80);
    CHECK(beat.whole.at("aorta") == Approx(80).epsilon(0.01));
    CHECK(beat.mean_mmHg > 70);
    CHECK(beat.mean_mmHg < 105);
    CHECK(beat.lowest_mmHg > 60);
    CHECK(beat.highest_mmHg < 140);
  }
}
