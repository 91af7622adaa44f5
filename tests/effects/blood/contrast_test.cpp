#include "host/simulator/effects/blood/contrast.h"

#include <catch2/catch.hpp>
#include <cmath>
#include <numbers>

#include "tests/effects/vascular_scene.h"
#include "tests/support/wires.h"

using Catch::Contains;
using torquer::effects::Contrast;
using torquer::effects::ContrastSettings;
using torquer::effects::Flow;
using torquer::effects::FlowEnd;
using torquer::effects::FlowGraph;
using torquer::effects::FlowInlet;
using torquer::effects::Pulse;
using torquer::test::kFork;
using torquer::test::Refusal;
using torquer::test::SceneOf;
using torquer::vessel::Centerline;
using torquer::vessel::CenterlineNetwork;

namespace {

// A straight vessel of 400 mm length and 2 mm radius; the blood flows at 100 mm/s.
struct StraightVessel {
  static constexpr double kRadiusMm = 2, kSpeedMmS = 100;
  static constexpr double kFlowML_s = 1e-3 * kSpeedMmS * std::numbers::pi * kRadiusMm * kRadiusMm;

  explicit StraightVessel(const Pulse& pulse = {}) {
    auto graph = std::make_unique<FlowGraph>(network);
    const int inlet = graph->NodeAt("tube", "start");
    const FlowEnd out{graph->NodeAt("tube", "end"), true, 0, 0};
    flow = std::make_unique<Flow>(std::move(graph), 3.5e-3,
                                  FlowInlet{.node = inlet, .mL_s = kFlowML_s},
                                  std::vector<FlowEnd>{out}, pulse);
  }

  CenterlineNetwork network{{Centerline("tube", {{0, 0, 0}, {400, 0, 0}}, {2, 2})}};
  std::unique_ptr<Flow> flow;
};

ContrastSettings Drip(double at_mm) {
  return {.site = ContrastSettings::Site::kPlace,
          .place = {0, at_mm},
          .rate_mL_s = 0.01,
          .concentration_mg_mL = 300,
          .dispersion_mm2_s = 0,
          .cell_mm = 1};
}

// Mean position in mm and variance in mm^2 of the dye along the vessel.
std::pair<double, double> Moments(const Contrast& contrast) {
  double mass = 0;
  double first = 0;
  double second = 0;
  const Contrast::Cells& cells = contrast.cells()[0];
  for (std::size_t i = 0; i < cells.count; ++i) {
    const double x = (static_cast<double>(i) + 0.5) * cells.length_mm;
    const double c = contrast.concentration_mg_mL()[cells.first + i];
    mass += c;
    first += c * x;
    second += c * x * x;
  }
  return {first / mass, second / mass - first / mass * first / mass};
}

double Missing(const Contrast& contrast) {
  return std::abs(contrast.injected_mg() - contrast.inside_mg() - contrast.washed_out_mg()) /
         contrast.injected_mg();
}

const Eigen::Vector3d kNowhere = Eigen::Vector3d::Zero();
const torquer::WireModel kWire = torquer::test::MakeWire({});

}  // namespace

TEST_CASE("A bolus travels at the mean velocity of the blood", "[effects]") {
  const StraightVessel vessel;
  Contrast contrast(*vessel.flow, Drip(20.5), kWire);
  double time_s = 0;
  const auto run = [&](int ticks, bool injecting) {
    for (int k = 0; k < ticks; ++k) contrast.Advance(time_s += 1e-3, 1e-3, injecting, kNowhere);
    return Moments(contrast).first;
  };
  // After 0.1 s of injection, the mean belongs to 0.05 s. The source's place is accurate to one
  // cell.
  run(100, true);
  const double after_1_s = run(900, false);
  CHECK(after_1_s == Approx(20.5 + StraightVessel::kSpeedMmS * (1 - 0.05)).margin(0.6));
  CHECK(run(1000, false) - after_1_s == Approx(StraightVessel::kSpeedMmS).epsilon(1e-4));
  CHECK(Missing(contrast) < 1e-12);
}

TEST_CASE("The speed is that of the pulse at every moment", "[effects]") {
  const StraightVessel vessel({60, 1});
  Contrast contrast(*vessel.flow, Drip(20.5), kWire);
  // Injected within 10 ms at the end of diastole, when blood at this depth stands still.
  contrast.Advance(0.99, 1e-2, true, kNowhere);
  const double start_mm = Moments(contrast).first;
  double time_s = 1;
  for (int tick = 0; tick < 350; ++tick) contrast.Advance(time_s += 1e-3, 1e-3, false, kNowhere);
  // One whole beat has passed.
  CHECK(Moments(contrast).first - start_mm == Approx(StraightVessel::kSpeedMmS).epsilon(0.01));
  const double after_mm = Moments(contrast).first;
  for (int tick = 0; tick < 600; ++tick) contrast.Advance(time_s += 1e-3, 1e-3, false, kNowhere);
  CHECK(Moments(contrast).first == Approx(after_mm).margin(0.05));
}

TEST_CASE("Dispersion widens a bolus by twice its coefficient in time", "[effects]") {
  const StraightVessel vessel;
  ContrastSettings settings = Drip(20.5);
  settings.dispersion_mm2_s = 150;
  Contrast contrast(*vessel.flow, settings, kWire);
  double time_s = 0;
  const auto run = [&](int ticks, bool injecting) {
    for (int k = 0; k < ticks; ++k) contrast.Advance(time_s += 1e-3, 1e-3, injecting, kNowhere);
  };
  run(20, true);
  run(700, false);
  const double early = Moments(contrast).second;
  run(1500, false);
  CHECK(Moments(contrast).second - early == Approx(2 * 150 * 1.5).epsilon(0.02));
}

TEST_CASE("The patient's limit is a reading only where it is set", "[effects]") {
  const StraightVessel vessel;
  const auto limits_mL = [&](const ContrastSettings& settings) {
    std::vector<double> found;
    for (const auto& reading : Contrast(*vessel.flow, settings, kWire).Readings()) {
      if (reading.name == "contrast_limit_mL") found.push_back(reading.value);
    }
    return found;
  };
  ContrastSettings settings = Drip(20.5);
  CHECK(limits_mL(settings).empty());
  settings.patient_limit_mL = 120;
  CHECK(limits_mL(settings) == std::vector<double>{120});
}

TEST_CASE("A front stays sharp and makes no new extremes", "[effects]") {
  const StraightVessel vessel;
  Contrast contrast(*vessel.flow, Drip(20.5), kWire);
  double time_s = 0;
  for (int tick = 0; tick < 2500; ++tick) contrast.Advance(time_s += 1e-3, 1e-3, true, kNowhere);
  // 0.01 mL/s of 300 mg/mL, diluted in the blood's flow plus 0.01 mL/s.
  const double level = 300 * 0.01 / (StraightVessel::kFlowML_s + 0.01);
  double width_mm = 0;
  for (const double c : contrast.concentration_mg_mL()) {
    CHECK(c >= 0);
    CHECK(c <= level * (1 + 1e-9));
    if (c > 0.1 * level && c < 0.9 * level) width_mm += 1;
  }
  // A first-order upwind scheme would smear the front over about 40 mm.
  CHECK(width_mm <= 12);
}

TEST_CASE("All dye is accounted for until the last is washed out", "[effects]") {
  SceneOf scene(kFork +
                "[effects.flow]\ninlet = \"stem\"\ninlet_mL_s = 5\nrate_per_min = 75\n"
                "[effects.contrast]\nrate_mL_s = 3\n");
  auto& contrast = scene.Get<Contrast>();
  double time_s = 0;
  double largest = 0;
  for (int tick = 0; tick < 3000; ++tick) {
    contrast.Advance(time_s += 1e-3, 1e-3, tick < 800, kNowhere);
    largest = std::max(largest, Missing(contrast));
  }
  CHECK(largest < 1e-9);
  CHECK(contrast.injected_mg() == Approx(3 * 320 * 0.8));
  // The fork is symmetric, so both branches contain equal dye.
  for (std::size_t k = 0; k < contrast.cells()[1].count; ++k) {
    const auto& all = contrast.concentration_mg_mL();
    CHECK(all[contrast.cells()[1].first + k] ==
          Approx(all[contrast.cells()[2].first + k]).margin(1e-9));
  }
  CHECK(contrast.inside_mg() > 0);
  for (int tick = 0; tick < 60000; ++tick) contrast.Advance(time_s += 1e-3, 1e-3, false, kNowhere);
  CHECK(contrast.clear());
  CHECK(contrast.inside_mg() == 0);
  CHECK(Missing(contrast) < 1e-9);
  const double washed_out_mg = contrast.washed_out_mg();
  scene->effects().back()->Restart();
  CHECK(washed_out_mg > 0);
  CHECK(contrast.washed_out_mg() == 0);
}

TEST_CASE("More dye than blood flows back, and is never denser than injected", "[effects]") {
  SceneOf scene(kFork +
                "[effects.flow]\ninlet = \"stem\"\ninlet_mL_s = 1\n"
                "[effects.contrast]\nrate_mL_s = 6\nat = \"place\"\ncenterline = \"left\"\n"
                "at_mm = 40\n");
  auto& contrast = scene.Get<Contrast>();
  double time_s = 0;
  for (int tick = 0; tick < 3000; ++tick) contrast.Advance(time_s += 1e-3, 1e-3, true, kNowhere);
  const auto& graph = contrast.flow().graph();
  for (std::size_t e = 0; e < graph.edges().size(); ++e) {
    const bool right = graph.network().curves()[graph.edges()[e].curve].name() == "right";
    const Contrast::Cells& cells = contrast.cells()[e];
    const double middle = contrast.concentration_mg_mL()[cells.first + cells.count / 2];
    if (right) CHECK(middle > 100);
  }
  for (const double c : contrast.concentration_mg_mL()) CHECK(c <= 320 * (1 + 1e-9));
  CHECK(Missing(contrast) < 1e-9);
}

TEST_CASE("Long steps carry dye as short ones do", "[effects]") {
  const StraightVessel vessel;
  Contrast fine(*vessel.flow, Drip(20.5), kWire);
  Contrast coarse(*vessel.flow, Drip(20.5), kWire);
  for (int k = 1; k <= 2000; ++k) fine.Advance(1e-3 * k, 1e-3, k <= 200, kNowhere);
  for (int k = 1; k <= 20; ++k) coarse.Advance(0.1 * k, 0.1, k <= 2, kNowhere);
  CHECK(coarse.injected_mg() == Approx(fine.injected_mg()));
  CHECK(Moments(coarse).first == Approx(Moments(fine).first).margin(0.5));
}

TEST_CASE("Contrast that cannot be is refused with key, value and remedy", "[effects]") {
  const std::string flow = "[effects.flow]\ninlet = \"stem\"\ninlet_mL_s = 5\n";
  CHECK_THAT(Refusal(kFork + "[effects.contrast]\nrate_mL_s = 3\n"),
             Contains("test.toml:") && Contains("needs [effects.flow]"));
  CHECK_THAT(Refusal(kFork + flow + "[effects.contrast]\nrate_mL_s = -3\n"),
             Contains("rate_mL_s = -3"));
  CHECK_THAT(Refusal(kFork + flow +
                     "[effects.contrast]\nrate_mL_s = 3\nat = \"place\"\n"
                     "centerline = \"lift\"\nat_mm = 3\n"),
             Contains("centerline") && Contains("left"));
  CHECK_THAT(Refusal(kFork + flow +
                     "[effects.contrast]\nrate_mL_s = 3\nat = \"place\"\n"
                     "centerline = \"left\"\nat_mm = 3000\n"),
             Contains("no place at 3000 mm"));
}
