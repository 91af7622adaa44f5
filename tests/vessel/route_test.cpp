#include "host/simulator/vessel/route.h"

#include <cmath>
#include <limits>
#include <random>

#include "catch2/catch.hpp"
#include "tests/support/paths.h"

namespace torquer::vessel {
namespace {

using Eigen::Vector3d;

Centerline Line(const std::string& name, const Vector3d& from, const Vector3d& to) {
  return Centerline(name, {from, (from + to) / 2, to}, {1, 1, 1});
}

// Length of the shortest route by Bellman and Ford: every pair of places is relaxed until none
// changes. Places of one curve are their difference in arc length apart, those of one joint 0.
double ReferenceLength(const CenterlineNetwork& network, const CenterlinePlace& from,
                       const CenterlinePlace& to) {
  std::vector<CenterlinePlace> places{from, to};
  std::vector<int> joints{-1, -2};
  for (std::size_t k = 0; k < network.joints().size(); ++k) {
    for (const CenterlinePlace& place : network.joints()[k].places) {
      places.push_back(place);
      joints.push_back(static_cast<int>(k));
    }
  }
  std::vector<double> length(places.size(), std::numeric_limits<double>::infinity());
  length[0] = 0;
  for (bool changes = true; changes;) {
    changes = false;
    for (std::size_t a = 0; a < places.size(); ++a) {
      for (std::size_t b = 0; b < places.size(); ++b) {
        double step = std::numeric_limits<double>::infinity();
        if (places[a].curve == places[b].curve) step = std::abs(places[a].s_mm - places[b].s_mm);
        if (joints[a] == joints[b]) step = 0;
        if (length[a] + step >= length[b] - 1e-9) continue;
        length[b] = length[a] + step;
        changes = true;
      }
    }
  }
  return length[1];
}

void CheckLegs(const CenterlineNetwork& network, const Route& route, const CenterlinePlace& from,
               const CenterlinePlace& to) {
  double sum_mm = 0;
  Vector3d at = network.At(from).position_mm;
  for (const RouteLeg& leg : route.legs) {
    CHECK((network.At({leg.curve, leg.from_mm}).position_mm - at).norm() < 2);
    sum_mm += std::abs(leg.to_mm - leg.from_mm);
    at = network.At({leg.curve, leg.to_mm}).position_mm;
  }
  CHECK((network.At(to).position_mm - at).norm() < 2);
  CHECK(sum_mm == Approx(route.length_mm).margin(0.1));
}

// Bundle of n curves of 25 mm along one line, each shifted against the one before it. Their ends
// meet many others, so the joints have many places.
CenterlineNetwork Bundle(int n) {
  std::vector<Centerline> curves;
  for (int k = 0; k < n; ++k) {
    const double s = k % 40 * 0.55;
    curves.push_back(Line("c" + std::to_string(k), {s, 0, 1e-4 * k}, {s + 25, 0, 1e-4 * k}));
  }
  return CenterlineNetwork(std::move(curves));
}

}  // namespace

TEST_CASE("a route is as short as the shortest one, and its legs lead from place to place") {
  const CenterlineNetwork arteries = ParseSlicerCurves(
      ReadCurveFiles(torquer::test::SourcePath("/host/scenes/meshes/neuro_arch/centerlines")));
  for (const CenterlineNetwork& network : {arteries, Bundle(60)}) {
    std::mt19937 random(3);
    std::uniform_real_distribution<double> part(0, 1);
    const auto place = [&] {
      const std::size_t curve = random() % network.curves().size();
      return CenterlinePlace{curve, part(random) * network.curves()[curve].length_mm()};
    };
    for (int k = 0; k < 25; ++k) {
      const CenterlinePlace from = place(), to = place();
      const Route route = FindRoute(network, from, to);
      REQUIRE(route.connected);
      CHECK(route.length_mm == Approx(ReferenceLength(network, from, to)).margin(1e-6));
      CheckLegs(network, route, from, to);
    }
  }
}

TEST_CASE("a route crosses the joint of a ring's ends, and does not go around it") {
  std::vector<Vector3d> ring;
  for (int k = 0; k <= 24; ++k) {
    const double angle = 2 * M_PI * k / 24;
    ring.emplace_back(20 * std::sin(angle), 20 * std::cos(angle) - 20, 0);
  }
  const CenterlineNetwork network({Centerline("ring", ring, std::vector<double>(ring.size(), 1)),
                                   Line("stem", {0, 0, 0}, {0, 30, 0})});
  const double length_mm = network.curves()[0].length_mm();
  const Route route = FindRoute(network, {0, 5}, {0, length_mm - 7});
  CHECK(route.length_mm == Approx(12));
  REQUIRE(route.legs.size() == 2);
  CHECK(route.legs[0].from_mm == 5);
  CHECK(route.legs[0].to_mm == Approx(0).margin(1e-6));
  CHECK(route.legs[1].to_mm == Approx(length_mm - 7));
}

TEST_CASE("the search for a route looks at steps in proportion to the places of joints") {
  for (const int curves : {125, 500}) {
    const CenterlineNetwork network = Bundle(curves);
    std::int64_t places = 0;
    for (const CenterlineNetwork::Joint& joint : network.joints()) {
      places += static_cast<std::int64_t>(joint.places.size());
    }
    INFO(curves << " curves, " << places << " places");
    CHECK(places > 20 * curves);
    // Two neighbors along the curve, the joint, and back from it; two for each end of the route.
    const Route route =
        FindRoute(network, {0, 0}, {network.curves().size() - 1, network.curves()[0].length_mm()});
    CHECK(route.connected);
    CHECK(route.steps <= 4 * places + 4);
  }
}

}  // namespace torquer::vessel
