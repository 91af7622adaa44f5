// Further inlets: a network in two parts, and two inlets of one part. Flows are compared with those
// of each part alone, and with circuits solved by hand.
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
using torquer::effects::FlowPlace;
using torquer::test::kFork;
using torquer::test::Refusal;
using torquer::test::SceneOf;

namespace {

// kFork, and a straight vessel of radius 2 mm beside it.
std::string TwoParts() {
  std::string text = kFork;
  text.insert(text.find("[entry]"),
              "[[vessel.tube]]\nname = \"far\"\npoints_mm = [[0, 100, 0], [200, 100, 0]]\n"
              "radii_mm = [2]\n");
  return text;
}

const std::string kStemInlet = "[effects.flow]\ninlet = \"stem\"\n";
const std::string kFarInlet = "[[effects.flow.other_inlet]]\ncenterline = \"far\"\nmL_s = 2\n";
const std::string kLeftInlet =
    "[[effects.flow.other_inlet]]\ncenterline = \"left\"\nend = \"end\"\nmL_s = 3\n";

// Resistance of a tube, mmHg s/mL, by Poiseuille's law in SI units.
double ResistanceOf(double length_mm, double radius_mm) {
  const double area = std::numbers::pi * std::pow(1e-3 * radius_mm, 4);
  return 8 * 3.5e-3 * 1e-3 * length_mm / area * 1e-6 / 133.322387415;
}

const double kLegMm = std::hypot(80, 40);

double FlowIn(const Flow& flow, const std::string& curve, double time_s) {
  std::vector<double> edges;
  flow.EdgesAt(time_s, edges);
  return edges[static_cast<std::size_t>(
      flow.graph().EdgeAt(flow.graph().network().Place(curve, 40.0)))];
}

double PressureIn(const Flow& flow, const std::string& curve, double s_mm, double time_s) {
  return flow.PressureAt(flow.PlaceOn(flow.graph().network().Place(curve, s_mm)), time_s);
}

}  // namespace

TEST_CASE("Each part of a vessel has the flow that it has alone", "[effects]") {
  // The second one advances in steps.
  const std::string more = GENERATE("", "compliance_mL_mmHg = 0.7\n");
  const std::string keys = kStemInlet + "inlet_mL_s = 5\nrate_per_min = 60\n";
  SceneOf alone(kFork + keys + more);
  // The compliance is that of all outlets, which divide it as their flows.
  const std::string all = more.empty() ? more : "compliance_mL_mmHg = 0.98\n";
  SceneOf both(TwoParts() + keys + all + kFarInlet);
  for (const double time_s : {0.1, 0.5}) {
    INFO(more << time_s);
    alone.Get<Flow>().AdvanceTo(time_s);
    both.Get<Flow>().AdvanceTo(time_s);
    for (const char* curve : {"stem", "left", "right"}) {
      CHECK(FlowIn(both.Get<Flow>(), curve, time_s) ==
            Approx(FlowIn(alone.Get<Flow>(), curve, time_s)).epsilon(1e-12));
      CHECK(PressureIn(both.Get<Flow>(), curve, 40, time_s) ==
            Approx(PressureIn(alone.Get<Flow>(), curve, 40, time_s)).epsilon(1e-12));
    }
    const double far_mL_s = 2 * both.Get<Flow>().pulse().At(time_s);
    CHECK(FlowIn(both.Get<Flow>(), "far", time_s) == Approx(far_mL_s).epsilon(1e-12));
    // Its bed takes 90 mmHg at its mean flow. Without a Windkessel the pressure follows the flow.
    if (!more.empty()) continue;
    const double bed_mmHg = 90 * far_mL_s / 2 + far_mL_s * ResistanceOf(200, 2);
    CHECK(PressureIn(both.Get<Flow>(), "far", 0, time_s) == Approx(bed_mmHg).epsilon(1e-9));
  }
}

TEST_CASE("Two inlets of one part feed the same outlet", "[effects]") {
  {
    SceneOf scene(kFork + kStemInlet + "inlet_mL_s = 5\n" + kLeftInlet);
    const Flow& flow = scene.Get<Flow>();
    CHECK(FlowIn(flow, "left", 0) == Approx(-3).epsilon(1e-12));
    CHECK(FlowIn(flow, "right", 0) == Approx(8).epsilon(1e-12));
    // The only outlet takes the whole flow, at a drop of 90 mmHg.
    CHECK(PressureIn(flow, "right", kLegMm, 0) == Approx(90).epsilon(1e-9));
  }
  // The first inlet keeps its mean pressure, whatever the second one delivers.
  SceneOf scene(kFork + kStemInlet + "inlet_mean_mmHg = 80\n" + kLeftInlet +
                "[[effects.flow.outlet]]\ncenterline = \"right\"\nresistance_mmHg_s_mL = 10\n");
  const Flow& flow = scene.Get<Flow>();
  CHECK(PressureIn(flow, "stem", 0, 0) == Approx(80).epsilon(1e-9));
  // (80 - p)/stem + 3 = p/(branch + 10) at the pressure p of the fork.
  const double stem = ResistanceOf(100, 3);
  const double onward = ResistanceOf(kLegMm, 3) + 10;
  const double p = (80 / stem + 3) / (1 / stem + 1 / onward);
  CHECK(FlowIn(flow, "right", 0) == Approx(p / onward).epsilon(1e-9));
}

TEST_CASE("A part whose inlet is a flow source has outlets by Murray's law", "[effects]") {
  SceneOf scene(TwoParts() + kStemInlet + "inlet_held_mmHg = 95\noutlet_mmHg = 90\n" + kFarInlet);
  const Flow& flow = scene.Get<Flow>();
  // Outlets of the other part have the pressure itself.
  CHECK(PressureIn(flow, "left", kLegMm, 0) == Approx(90).epsilon(1e-12));
  CHECK(PressureIn(flow, "far", 200, 0) == Approx(90 + 90).epsilon(1e-12));
}

TEST_CASE("Behind a closed place only the inlets that still reach it deliver", "[effects]") {
  SceneOf scene(kFork + kStemInlet + "inlet_mL_s = 5\n" + kLeftInlet +
                "[[effects.flow.outlet]]\ncenterline = \"right\"\nresistance_mmHg_s_mL = 10\n");
  const Flow& flow = scene.Get<Flow>();
  const FlowPlace stem = flow.PlaceOn(flow.graph().network().Place("stem", 50.0));
  // The left inlet's 3 mL/s go on to the right outlet.
  const double onward = ResistanceOf(kLegMm, 3) + 10;
  CHECK(flow.PressureBehind(stem).mmHg == Approx(3 * onward).epsilon(1e-6));
}

TEST_CASE("Contrast agent stays in its part of the vessel", "[effects]") {
  SceneOf scene(TwoParts() + kStemInlet + "inlet_mL_s = 5\n" + kFarInlet);
  const Flow& flow = scene.Get<Flow>();
  const ContrastSettings settings{.site = ContrastSettings::Site::kPlace,
                                  .place = flow.graph().network().Place("far", 40.0),
                                  .rate_mL_s = 1,
                                  .concentration_mg_mL = 300,
                                  .dispersion_mm2_s = 0,
                                  .cell_mm = 2};
  const torquer::WireModel wire = torquer::test::MakeWire({});
  Contrast contrast(flow, settings, wire);
  for (int k = 1; k <= 400; ++k) {
    contrast.Advance(0.01 * k, 0.01, true, Eigen::Vector3d::Zero());
  }
  const auto at = [&](const std::string& curve, double s_mm) {
    const auto place = flow.graph().network().Place(curve, s_mm);
    const auto& cells = contrast.cells()[static_cast<std::size_t>(flow.graph().EdgeAt(place))];
    return contrast
        .concentration_mg_mL()[cells.first + static_cast<std::size_t>(s_mm / cells.length_mm)];
  };
  // 1 mL/s of agent in 2 mL/s of blood.
  CHECK(at("far", 120) == Approx(100).epsilon(1e-6));
  for (const char* curve : {"stem", "left", "right"}) CHECK(at(curve, 50) == 0);
}

TEST_CASE("A part without an inlet or an outlet is refused with the remedy", "[effects]") {
  const std::string keys = kStemInlet + "inlet_mL_s = 5\n";
  CHECK_THAT(Refusal(TwoParts() + keys),
             Contains("outlet \"far\" start is not connected to the inlet") &&
                 Contains("name an inlet of that part in [[effects.flow.other_inlet]]"));
  const std::string far_end = "centerline = \"far\"\nend = \"end\"\nmL_s = 2\n";
  CHECK_THAT(Refusal(TwoParts() + keys + kFarInlet + "[[effects.flow.other_inlet]]\n" + far_end),
             Contains("there is no outlet: the part of the network with \"far\" start"));
  CHECK_THAT(Refusal(TwoParts() + keys + kFarInlet + kFarInlet),
             Contains("centerline = 'far'") && Contains("named twice"));
  CHECK_THAT(
      Refusal(kFork + keys + "[[effects.flow.other_inlet]]\ncenterline = \"left\"\nmL_s = 1\n"),
      Contains("centerline = 'left'") && Contains("joined to other curves"));
  CHECK_THAT(Refusal(kFork + keys + kLeftInlet +
                     "[[effects.flow.outlet]]\ncenterline = \"left\"\n"
                     "pressure_mmHg = 5\n"),
             Contains("not an outlet: it is an inlet"));
}
