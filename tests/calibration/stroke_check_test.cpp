#include "calibration/stroke_check.h"

#include <catch2/catch.hpp>
#include <random>

#include "tests/calibration/angles.h"
#include "tests/calibration/simulated_hand.h"

namespace {

using namespace torquer::calibration;
using Catch::Contains;
using torquer::test::ExpectationOf;
using torquer::test::HandFaults;
using torquer::test::kDegree_rad;
using torquer::test::RandomTruth;
using torquer::test::SimulatedStrokes;

constexpr int kPushCount = 6;
constexpr int kTurnCount = 5;
constexpr std::size_t kBadPush = 3;
constexpr std::size_t kBadTurn = kPushCount + 2;

// A run with one spoiled stroke.
struct StrokesRun {
  explicit StrokesRun(std::uint64_t seed) : random(seed) {
    truth = RandomTruth(random);
    strokes = SimulatedStrokes(truth, faults, kPushCount, kTurnCount, random);
  }

  // Adds a cylinder motion to a stroke; the motion is undone afterwards unless it `stays`.
  void Spoil(std::size_t index, double mm, double rad, bool stays = false) {
    torquer::test::SimulatedSensor sensor(truth, 0.0, random);
    sensor.MoveTo({mm, rad});
    RecordedStroke& recorded = strokes[index];
    recorded.stroke.axial_counts += sensor.axial();
    recorded.stroke.transverse_counts += sensor.transverse();
    if (stays) return;
    recorded.back_axial_counts -= sensor.axial();
    recorded.back_transverse_counts -= sensor.transverse();
  }
  std::vector<Rejection> Judge() const { return JudgeStrokes(strokes, ExpectationOf(faults)); }

  // Reason why the spoiled stroke was refused; "" if it was accepted. No other stroke may be
  // refused.
  std::string Reason(std::size_t index) const {
    const std::vector<Rejection> rejections = Judge();
    for (std::size_t i = 0; i < rejections.size(); ++i) {
      if (i == index) continue;
      INFO("stroke " << i << ": " << rejections[i].value_or(""));
      CHECK_FALSE(rejections[i]);
    }
    return rejections[index].value_or("");
  }

  std::mt19937_64 random;
  HandFaults faults;
  MotionParameters truth;
  std::vector<RecordedStroke> strokes;
};

}  // namespace

TEST_CASE("Good strokes are accepted") {
  constexpr std::uint64_t kFirstSeed = 1000;
  constexpr int kRuns = 500;
  int refused = 0;
  for (std::uint64_t seed = kFirstSeed; seed < kFirstSeed + kRuns; ++seed) {
    for (const Rejection& rejection : StrokesRun(seed).Judge()) refused += rejection.has_value();
  }
  CAPTURE(kFirstSeed);
  CHECK(refused < 0.005 * kRuns * (kPushCount + kTurnCount));
}

TEST_CASE("Outliers, slips, lifts and wrong strokes are refused with the reason") {
  const std::uint64_t seed = GENERATE(1u, 2u, 3u, 4u, 5u, 6u, 7u, 8u, 9u, 10u);
  CAPTURE(seed);
  StrokesRun run(seed);
  SECTION("a push that stopped short") {
    run.Spoil(kBadPush, -8.0, 0.0);
    CHECK_THAT(run.Reason(kBadPush), Contains("shorter than the others"));
  }
  SECTION("a push begun too early") {
    run.Spoil(kBadPush, 8.0, 0.0);
    CHECK_THAT(run.Reason(kBadPush), Contains("longer than the others"));
  }
  SECTION("a push on whose way back it slipped") {
    run.strokes[kBadPush].back_axial_counts += 400;
    CHECK_THAT(run.Reason(kBadPush), Contains("the return ended"));
  }
  SECTION("a push that slipped, and came back whole") {
    run.Spoil(kBadPush, -8.0, 0.0, /*stays=*/true);
    CHECK_THAT(run.Reason(kBadPush), Contains("slipped"));
  }
  SECTION("half a push") {
    run.Spoil(kBadPush, -100.0, 0.0);
    CHECK_THAT(run.Reason(kBadPush), Contains("too short"));
  }
  SECTION("two thirds of a push") {
    run.Spoil(kBadPush, -50.0, 0.0);
    CHECK_THAT(run.Reason(kBadPush), Contains("the push was incomplete"));
  }
  SECTION("a pull") {
    run.Spoil(kBadPush, -300.0, 0.0);
    CHECK_THAT(run.Reason(kBadPush), Contains("wrong direction"));
  }
  SECTION("a little turned while pushing") {
    run.Spoil(kBadPush, 0.0, 15.0 * kDegree_rad);
    CHECK_THAT(run.Reason(kBadPush), Contains("turned while pushing") && Contains("more than"));
  }
  SECTION("much turned while pushing") {
    run.Spoil(kBadPush, 0.0, 4.0 * std::numbers::pi);
    CHECK_THAT(run.Reason(kBadPush), Contains("turned while pushing"));
  }
  SECTION("one turn too few") {
    run.Spoil(kBadTurn, 0.0, -360.0 * kDegree_rad);
    CHECK_THAT(run.Reason(kBadTurn), Contains("turns") || Contains("less than the others"));
  }
  SECTION("a tenth of a turn too much") {
    run.Spoil(kBadTurn, 0.0, 36.0 * kDegree_rad);
    CHECK_THAT(run.Reason(kBadTurn), Contains("more than the others: miscounted"));
  }
  SECTION("turned the wrong way") {
    run.Spoil(kBadTurn, 0.0, -1440.0 * kDegree_rad);
    CHECK_THAT(run.Reason(kBadTurn), Contains("wrong direction"));
  }
  SECTION("a push in place of a turn") {
    run.Spoil(kBadTurn, 60.0, -720.0 * kDegree_rad);
    CHECK_THAT(run.Reason(kBadTurn), Contains("pushed while turning"));
  }
  SECTION("a little pushed while turning") {
    run.Spoil(kBadTurn, 6.0, 0.0);
    CHECK_THAT(run.Reason(kBadTurn), Contains("pushed while turning, by") && Contains("more"));
  }
  SECTION("a turn that slipped on the way back") {
    run.strokes[kBadTurn].back_transverse_counts += 200;
    CHECK_THAT(run.Reason(kBadTurn), Contains("turned back, it stood"));
  }
  SECTION("lifted") {
    run.strokes[kBadPush].lifted = true;
    CHECK_THAT(run.Reason(kBadPush), Contains("lifted"));
  }
  SECTION("a sensor that fell silent") {
    run.strokes[kBadTurn].faulty = true;
    CHECK_THAT(run.Reason(kBadTurn), Contains("did not answer"));
  }
  SECTION("a device that restarted") {
    run.strokes[kBadTurn].interrupted = true;
    CHECK_THAT(run.Reason(kBadTurn), Contains("restarted"));
  }
}

TEST_CASE("Two outliers do not hide each other") {
  StrokesRun run(1);
  run.Spoil(1, -9.0, 0.0);
  run.Spoil(4, -7.0, 0.0);
  const std::vector<Rejection> rejections = run.Judge();
  for (std::size_t i = 0; i < rejections.size(); ++i) {
    CAPTURE(i, rejections[i].value_or(""));
    CHECK(rejections[i].has_value() == (i == 1 || i == 4));
  }
}

TEST_CASE("An unsteady hand is measured, not refused") {
  constexpr std::uint64_t kSeed = 9;
  CAPTURE(kSeed);
  std::mt19937_64 random(kSeed);
  int refused = 0;
  constexpr int kRuns = 200;
  for (int i = 0; i < kRuns; ++i) {
    HandFaults faults;
    const StrokeExpectation declared = ExpectationOf(faults);
    faults.push_turn_rad *= 5.0;
    faults.turn_push_mm *= 5.0;
    for (const Rejection& rejection :
         JudgeStrokes(SimulatedStrokes(RandomTruth(random), faults, kPushCount, kTurnCount, random),
                      declared)) {
      refused += rejection.has_value();
    }
  }
  CHECK(refused < 0.1 * kRuns * (kPushCount + kTurnCount));
}
