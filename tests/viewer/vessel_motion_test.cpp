#include "host/viewer/vessel_motion.h"

#include <catch2/catch.hpp>
#include <cmath>
#include <nlohmann/json.hpp>

#include "host/simulator/scene/scene.h"
#include "host/simulator/vessel/surface_net.h"
#include "host/viewer/page_messages.h"
#include "tests/support/paths.h"

using namespace torquer;
using namespace torquer::viewer;

namespace {

double PulseOf(const effects::PeriodicMotion& motion, double time_s) {
  const double periods = time_s / motion.settings().period_s + motion.settings().phase;
  return motion.PulseAt(periods - std::floor(periods));
}

struct Deviation {
  double largest_mm = 0;
  double way_mm = 0;  // path of the farthest point
};

// Deviation of the vessel's surface, as the page moves it, from the field that the wire feels.
Deviation DeviationOf(scene::Scene& scene) {
  const Motions motions = MotionsOf(scene);
  const vessel::Vessel& vessel = scene.vessel();
  const auto points = vessel::SurfaceInAbout(4000, *vessel.field, vessel.bounds_mm).vertices_mm;
  const std::vector<Shares> shares = SharesOf(motions, points);
  Deviation deviation;
  for (const double time_s : {0.05, 0.13, 0.21, 0.4, 0.9, 1.3, 2.2, 3.05}) {
    vessel::MovingField& field = *scene.moving_field();
    field.SetTime(time_s);
    std::vector<double> pulses;
    for (const auto* motion : motions) pulses.push_back(PulseOf(*motion, time_s));
    for (std::size_t i = 0; i < points.size(); ++i) {
      const Eigen::Vector3d moved = Moved(points[i], motions, shares, i, pulses);
      const Eigen::Vector3d true_mm = field.Moved(points[i], points[i]);
      deviation.largest_mm = std::max(deviation.largest_mm, (moved - true_mm).norm());
      deviation.way_mm = std::max(deviation.way_mm, (true_mm - points[i]).norm());
    }
  }
  return deviation;
}

}  // namespace

TEST_CASE("The drawn position of a moving vessel is that of the wall for the wire") {
  for (const char* name : {"beating_heart", "coronary", "everything"}) {
    INFO(name);
    scene::Scene scene(test::SourcePath(std::string("/host/scenes/") + name + ".toml"));
    const Deviation deviation = DeviationOf(scene);
    CAPTURE(deviation.largest_mm, deviation.way_mm);
    CHECK(deviation.way_mm > 3);
    CHECK(deviation.largest_mm < 0.1);
  }
}

TEST_CASE("A page gets the motions of a vessel, and fractions for all moving points") {
  scene::Scene scene(test::SourcePath("/host/scenes/everything.toml"));
  const auto motions = MotionsOf(scene);
  REQUIRE(motions.size() == 2);
  const auto text =
      nlohmann::json::parse(LinesText(scene.vessel().centerlines, nullptr, 1, motions));
  REQUIRE(text["motions"].size() == 2);
  for (std::size_t k = 0; k < 2; ++k) {
    const auto& motion = text["motions"][k];
    CHECK(motion["period_s"] == motions[k]->settings().period_s);
    CHECK(motion["phase"] == motions[k]->settings().phase);
    CHECK(motion["way_mm"][1] == motions[k]->settings().way_mm.y());
    const auto pulse = motion["pulse"].get<std::vector<double>>();
    CHECK(pulse[pulse.size() / 4] == motions[k]->PulseAt(0.25));
    // A page interpolates linearly between two samples.
    for (std::size_t i = 0; i + 1 < pulse.size(); ++i) {
      const double between = (static_cast<double>(i) + 0.5) / static_cast<double>(pulse.size());
      CHECK(std::abs(motions[k]->PulseAt(between) - 0.5 * (pulse[i] + pulse[i + 1])) < 1e-3);
    }
    for (const auto& curve : text["curves"]) {
      CHECK(3 * curve["shares"][k].size() == 4 * curve["points_mm"].size());
    }
  }
  vessel::TriangleMesh mesh;
  mesh.vertices_mm = {{0, 0, 0}, scene.vessel().centerlines.curves().back().points_mm().back()};
  mesh.triangles = {{0, 1, 0}};
  const std::string frame = VesselFrame(mesh, 1, motions);
  REQUIRE(frame.size() == 32 + 2 * 12 + 12 + 2 * 2 * 4 * sizeof(float));
  CHECK(frame[2] == 2);
  const Shares last = SharesOf(motions, mesh.vertices_mm)[1];
  REQUIRE(last.size() == 8);
  CHECK(frame.substr(frame.size() - 32) ==
        std::string(reinterpret_cast<const char*>(last.data()), 32));
}
