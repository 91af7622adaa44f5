// Lateral plane of a biplane system, compared with the first plane turned to the same angle.
#include <catch2/catch.hpp>
#include <string>
#include <vector>

#include "host/simulator/simulation.h"
#include "host/support/angles.h"
#include "tests/effects/vascular_scene.h"

using torquer::kRadPerDeg;
using torquer::effects::ImageSource;
using torquer::simulator::Command;
using torquer::simulator::Simulation;
using torquer::test::kStraight;
using torquer::test::Reading;
using torquer::test::SceneOf;

namespace {

std::string System(int seed, const std::string& more = "") {
  return "[effects.flow]\ninlet = \"tube\"\ninlet_mL_s = 5\n[effects.contrast]\nrate_mL_s = 5\n"
         "[effects.fluoroscopy]\nwidth_px = 96\nheight_px = 96\nmode = \"subtraction\"\nseed = " +
         std::to_string(seed) + "\n" + more;
}

struct Taken {
  std::vector<ImageSource::Picture> pictures;
  double pulses, kerma_mGy, area_Gy_cm2;
};

// Pictures and dose of a plane in one second. The C-arm is at a fixed angle; dye flows from 0.4 s
// on.
Taken TakenBy(Simulation& session, std::size_t plane, double lao_deg, const std::string& prefix) {
  Taken taken;
  for (int k = 1; k <= 100; ++k) {
    Command command;
    command.target[0].insertion_mm = 40 + 0.1 * k;
    command.time_s = 0.01 * k;
    command.controls.lao_rad = kRadPerDeg * lao_deg;
    command.controls.xray = k > 10;
    command.controls.contrast = k > 40;
    command.controls.table = {.left_mm = k > 60 ? 8.0 : 0, .head_mm = 3, .height_mm = 0.2 * k};
    torquer::CountedBudget budget(3000);
    session.Tick(command, budget);
    if (!session.picture_due(plane)) continue;
    session.image(plane)->Render(taken.pictures.emplace_back());
  }
  taken.pulses = Reading(session, prefix + "xray_pulses");
  taken.kerma_mGy = Reading(session, prefix + "air_kerma_mGy");
  taken.area_Gy_cm2 = Reading(session, prefix + "kerma_area_Gy_cm2");
  return taken;
}

}  // namespace

TEST_CASE("The lateral plane shows what the C-arm would show from there", "[effects]") {
  SceneOf biplane(kStraight + System(5, "[effects.lateral_plane]\nlao_deg = 70\n"));
  Simulation both(*biplane);
  REQUIRE(both.image_count() == 2);
  const Taken lateral = TakenBy(both, 1, -20, "lateral_");
  // The lateral plane's noise uses the next seed.
  SceneOf other(kStraight + System(6));
  Simulation alone(*other);
  REQUIRE(alone.image_count() == 1);
  CHECK(alone.image(1) == nullptr);
  CHECK_FALSE(alone.picture_due(1));
  const Taken turned = TakenBy(alone, 0, 70, "");
  REQUIRE(lateral.pictures.size() == 14);
  REQUIRE(turned.pictures.size() == 14);
  for (std::size_t k = 0; k < 14; ++k) {
    CHECK(lateral.pictures[k].gray == turned.pictures[k].gray);
    CHECK(lateral.pictures[k].controls.lao_rad == Approx(70 * kRadPerDeg));
  }
  CHECK(lateral.pulses == 14);
  CHECK(lateral.kerma_mGy == turned.kerma_mGy);
  CHECK(lateral.area_Gy_cm2 == turned.area_Gy_cm2);
}

TEST_CASE("The lateral plane changes neither the C-arm's pictures nor its dose", "[effects]") {
  SceneOf biplane(kStraight + System(5, "[effects.lateral_plane]\n"));
  SceneOf single(kStraight + System(5));
  Simulation both(*biplane);
  Simulation one(*single);
  const Taken first = TakenBy(both, 0, 30, "");
  const Taken same = TakenBy(one, 0, 30, "");
  REQUIRE(first.pictures.size() == same.pictures.size());
  for (std::size_t k = 0; k < same.pictures.size(); ++k) {
    CHECK(first.pictures[k].gray == same.pictures[k].gray);
  }
  CHECK(first.kerma_mGy == same.kerma_mGy);
  CHECK(both.state_hash() == one.state_hash());
  // The body is wider from the side: 90 degrees need more dose than 30.
  CHECK(Reading(both, "lateral_air_kerma_mGy") > first.kerma_mGy);
}

TEST_CASE("A copied session continues with both planes", "[effects]") {
  SceneOf biplane(kStraight + System(5, "[effects.lateral_plane]\n"));
  Simulation session(*biplane);
  TakenBy(session, 1, 0, "lateral_");
  const auto twin_scene = (*biplane).MakeTwin();
  Simulation twin(*twin_scene, session);
  CHECK(Reading(twin, "lateral_xray_pulses") == Reading(session, "lateral_xray_pulses"));
  for (Simulation* one : {&session, &twin}) {
    Command command;
    command.target[0].insertion_mm = 55;
    command.time_s = 1.2;
    command.controls.xray = true;
    torquer::CountedBudget budget(3000);
    one->Tick(command, budget);
  }
  ImageSource::Picture a, b;
  REQUIRE(session.picture_due(1));
  REQUIRE(twin.picture_due(1));
  session.image(1)->Render(a);
  twin.image(1)->Render(b);
  CHECK(a.gray == b.gray);
}
