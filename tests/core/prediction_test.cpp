// Predictions of a feed and of a vessel's motion.
#include <Eigen/Geometry>
#include <catch2/catch.hpp>
#include <cmath>
#include <limits>

#include "host/simulator/core/newton/feed_prediction.h"
#include "host/simulator/core/newton/travel_prediction.h"
#include "tests/support/wires.h"

namespace torquer::test {
namespace {

constexpr double kAnyMm = std::numeric_limits<double>::infinity();

// Straight wire of 20 segments of 1 mm.
struct Straight {
  WireModel model = MakeWire({.segment_mm = 1, .max_length_mm = 30});
  WireState state = LayStraight(model, 20);

  // Turns the distal half of the wire about an axis.
  void TurnHalf(double angle_rad, const Vector3d& axis) {
    const Eigen::AngleAxisd turn(angle_rad, axis);
    std::vector<Vector3d> turned;
    const std::vector<Vector3d>& tangents = state.tangents();
    for (std::size_t i = tangents.size(); i-- > tangents.size() / 2;) {
      turned.push_back(turn * tangents[i]);
    }
    state.TurnDistal(model, turned);
  }
  double TipAngle(const Vector3d& from) const {
    return std::acos(std::min(1.0, from.dot(state.tangents().back())));
  }
  Vector3d Across() const { return state.tangents().front().unitOrthogonal(); }
};

TEST_CASE("A vessel's motion is predicted from the one before, in proportion to its travel") {
  Straight wire;
  TravelPrediction prediction(wire.model);
  const Vector3d across = wire.Across();
  prediction.Travel(wire.model, 0.1, kAnyMm, wire.state);
  CHECK(wire.TipAngle(wire.state.tangents().front()) < 1e-7);
  wire.TurnHalf(0.01, across);
  Vector3d tip = wire.state.tangents().back();
  prediction.Travel(wire.model, 0.3, kAnyMm, wire.state);
  CHECK(wire.TipAngle(tip) == Approx(0.03).epsilon(1e-3));
  CHECK((wire.state.tangents()[5] - wire.state.tangents()[0]).norm() < 1e-12);
  // A prediction and its correction add up to the next motion.
  wire.TurnHalf(-0.02, across);
  tip = wire.state.tangents().back();
  prediction.Travel(wire.model, 0.3, kAnyMm, wire.state);
  CHECK(wire.TipAngle(tip) == Approx(0.01).epsilon(1e-3));
}

TEST_CASE("A vessel's motion is not predicted beyond the limits") {
  Straight wire;
  TravelPrediction prediction(wire.model);
  const auto turned_by = [&](double first_mm, double then_mm, double most_mm, double turn_rad) {
    prediction.Forget();
    prediction.Travel(wire.model, first_mm, kAnyMm, wire.state);
    wire.TurnHalf(turn_rad, wire.Across());
    const Vector3d tip = wire.state.tangents().back();
    prediction.Travel(wire.model, then_mm, most_mm, wire.state);
    return wire.TipAngle(tip);
  };
  CHECK(turned_by(0.1, 0.1, kAnyMm, 0.01) > 0.009);
  CHECK(turned_by(0.1, 0.5, kAnyMm, 0.01) < 1e-7);
  CHECK(turned_by(0, 0.1, kAnyMm, 0.01) < 1e-7);
  CHECK(turned_by(0.1, 0.1, kAnyMm, 0.2) < 1e-7);
  // The tip of a half of 10 mm moves by 0.1 mm.
  CHECK(turned_by(0.1, 0.1, 0.11, 0.01) > 0.009);
  CHECK(turned_by(0.1, 0.1, 0.09, 0.01) < 1e-7);
}

TEST_CASE("A feed repeats the relaxation after the last feed without the vessel's motions since") {
  for (const bool finished : {true, false}) {
    Straight wire;
    FeedPrediction prediction(wire.model);
    const Vector3d across = wire.Across();
    prediction.Feed(wire.model, 20.1, kAnyMm, wire.state);
    wire.TurnHalf(0.01, across);
    if (finished) prediction.Finish(wire.state);
    wire.TurnHalf(0.04, across);
    if (finished) prediction.Finish(wire.state);
    const Vector3d tip = wire.state.tangents().back();
    prediction.Feed(wire.model, 20.2, kAnyMm, wire.state);
    CHECK(wire.TipAngle(tip) == Approx(finished ? 0.01 : 0.05).epsilon(2e-2));
  }
}

TEST_CASE("Predictions that differ in any memory have different hashes") {
  Straight wire;
  TravelPrediction none(wire.model);
  TravelPrediction near(wire.model);
  TravelPrediction far(wire.model);
  near.Travel(wire.model, 0.1, kAnyMm, wire.state);
  far.Travel(wire.model, 0.2, kAnyMm, wire.state);
  CHECK(none.Hash(1) != near.Hash(1));
  CHECK(near.Hash(1) != far.Hash(1));
  FeedPrediction open(wire.model);
  open.Feed(wire.model, 20.1, kAnyMm, wire.state);
  FeedPrediction finished = open;
  wire.TurnHalf(0.01, wire.Across());
  FeedPrediction later = open;
  finished.Finish(wire.state);
  CHECK(open.Hash(1) == later.Hash(1));
  CHECK(open.Hash(1) != finished.Hash(1));
}

}  // namespace
}  // namespace torquer::test
