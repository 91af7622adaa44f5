// Instruments beside each other under random hand motion, in a vessel and in the lumen of an
// instrument around both. They push, withdraw, pass and turn, but never pass through each other.
#include <catch2/catch.hpp>
#include <cmath>
#include <cstdlib>
#include <map>
#include <random>
#include <utility>

#include "host/simulator/core/newton/newton_relaxation.h"
#include "host/simulator/core/stack/instrument_stack.h"
#include "host/simulator/core/stack/pair_order.h"
#include "tests/support/analytic_fields.h"
#include "tests/support/draws.h"
#include "tests/support/invariants.h"
#include "tests/support/sanitizer.h"
#include "tests/support/wires.h"

namespace torquer::test {
namespace {

enum Layout { kTwoWires, kBesideCatheter, kInGuide };

// Instruments with bent tips in the bend of a vessel. Half of these stacks twist.
struct DrawnBeside {
  const Layout layout;
  Torus field{Side::kInside, 20, 1.6};
  WallModel wall;
  InstrumentStack stack;
  std::vector<EnergyTerm*> none;
  std::unique_ptr<Relaxation> relaxation;
  WireState state;

  static std::vector<WireModel> Instruments(Layout layout, std::mt19937& random) {
    const double segment_mm = Between(random, 0.6, 1.5);
    const double ratio = random() % 2 == 0 ? 0 : Evenly(random, 0.3, 3);  // GJ / EI
    const double rigidity = Evenly(random, 0.05, 5);
    const auto make = [&](double radius_mm, double offset_mm) {
      const double own = rigidity * Evenly(random, 0.3, 3);
      const double torsional = ratio * own;
      return WireModel(segment_mm,
                       {{0, own, radius_mm, Between(random, -0.25, 0.25), 0, torsional},
                        {8, own, radius_mm, 0, 0, torsional}},
                       8, 90, BendingLaw::kExact,
                       {.point_mm = {20, 0, offset_mm}, .direction = Vector3d::UnitY()});
    };
    std::vector<WireModel> all;
    all.push_back(make(0.18, 0));
    if (layout == kBesideCatheter) all.push_back(make(0.4, 0));
    all.push_back(make(0.18, layout == kBesideCatheter ? 0.7 : 0.45));
    if (layout == kInGuide) all.push_back(make(0.9, 0));
    return all;
  }
  static Clearance RoomOf(Layout layout) {
    Clearance room{.stiffness_N_mm2 = 1};
    if (layout == kBesideCatheter) {
      room.has_room[1] = room.is_beside[2] = true;
      room.lumen_radius_mm[1] = 0.25;
      return room;
    }
    room.is_beside[1] = true;
    room.has_room[2] = layout == kInGuide;
    room.lumen_radius_mm[2] = 0.75;
    return room;
  }

  DrawnBeside(Layout of, std::mt19937& random)
      : layout(of),
        wall{.stiffness_N_mm2 = Evenly(random, 0.3, 3), .points_per_segment = 2},
        stack(Instruments(of, random), RoomOf(of)),
        relaxation(MakeNewtonRelaxation(stack, field, wall, {}, none)),
        state(stack.empty_rod(), stack.size()) {
    relaxation->Restart(state);
  }
  // Least distance of instruments beside each other, in parts of that at which they touch.
  double LeastDistance() const {
    double least = 1;
    for (const BetweenCurves& between : relaxation->Current().between) {
      for (const BetweenCurves::Neighbor& neighbor : between.neighbors) {
        least = std::min(least, neighbor.apart_mm / neighbor.touching_mm);
      }
    }
    return least;
  }
  // Transverse offsets between instruments within twice the distance at which they touch. Keys:
  // pair of curves, and segment counted from the tip of the inner one.
  std::map<std::pair<int, int>, Vector3d> CloseOffsets() const {
    std::map<std::pair<int, int>, Vector3d> offsets;
    int pair = 0;
    for (const BetweenCurves& between : relaxation->Current().between) {
      ++pair;
      for (const BetweenCurves::Neighbor& neighbor : between.neighbors) {
        if (neighbor.apart_mm > 2 * neighbor.touching_mm) continue;
        const SegmentPair& on = between.groups[static_cast<std::size_t>(neighbor.group)];
        const Curve& inner = state.curve(between.inner);
        const Curve& outer = state.curve(between.outer);
        const auto i = static_cast<std::size_t>(on.inner);
        const auto m = static_cast<std::size_t>(on.outer);
        const Vector3d apart = inner.nodes()[i] - outer.nodes()[m];
        const Vector3d& along = outer.tangents()[m];
        offsets[{pair, inner.segments() - on.inner}] = apart - apart.dot(along) * along;
      }
    }
    return offsets;
  }
};

// Number of places at which two instruments changed sides between two looks, although they were
// close at both.
int CountPassed(const std::map<std::pair<int, int>, Vector3d>& before,
                const std::map<std::pair<int, int>, Vector3d>& now) {
  int passed = 0;
  for (const auto& [place, offset] : now) {
    const auto found = before.find(place);
    if (found != before.end() && found->second.dot(offset) < 0) ++passed;
  }
  return passed;
}

// True if all pairs' groups can be met from the tips on, without a way back on any curve.
bool InOrder(const WireState& state, const std::vector<BetweenCurves>& between) {
  std::vector<int> left;
  for (const BetweenCurves& pair : between) left.push_back(static_cast<int>(pair.groups.size()));
  std::vector<int> cuts;
  for (int c = 0; c < state.curves(); ++c) cuts.push_back(state.curve(c).segments());
  for (auto k = NextPair(between, left); k < between.size(); k = NextPair(between, left)) {
    const SegmentPair& on = between[k].groups[static_cast<std::size_t>(--left[k])];
    int& inner = cuts[static_cast<std::size_t>(between[k].inner)];
    int& outer = cuts[static_cast<std::size_t>(between[k].outer)];
    if (on.inner >= inner || on.outer >= outer) return false;
    inner = on.inner + 1;
    outer = on.outer + 1;
  }
  return true;
}

TEST_CASE("Instruments beside each other never pass through each other, for any hands") {
  const auto layout = GENERATE(kTwoWires, kBesideCatheter, kInGuide);
  const char* text = std::getenv("TORQUER_SEED");
  const unsigned first =
      text == nullptr ? 1 : static_cast<unsigned>(std::strtoul(text, nullptr, 10));
  for (unsigned seed = first; seed < first + static_cast<unsigned>(Rounds(16, 8)); ++seed) {
    INFO("TORQUER_SEED=" << seed);
    std::mt19937 random(seed);
    DrawnBeside drawn(layout, random);
    const int count = drawn.stack.size();
    InstrumentPoses goal(count);
    double least = 1;
    int passed = 0;
    std::map<std::pair<int, int>, Vector3d> before;
    constexpr int kMoves = Rounds(60, 3);
    for (int move = 0; move < kMoves; ++move) {
      for (int k = 0; k < count; ++k) {
        goal[k].insertion_mm = std::clamp(goal[k].insertion_mm + Between(random, -4, 6), 0.0, 60.0);
        goal[k].rotation_rad += Between(random, -3, 3);
      }
      if (move == kMoves / 2) goal = InstrumentPoses(count);  // all out, then in again
      // One iteration at a time; hands do not wait until the instruments are at rest.
      const int looks = static_cast<int>(5 + random() % 60);
      for (int look = 0; look < looks; ++look) {
        CountedBudget budget(1);
        const TickReport report = drawn.relaxation->Tick(goal, budget, drawn.state);
        const auto now = drawn.CloseOffsets();
        passed += CountPassed(before, now);
        before = now;
        CHECK(InOrder(drawn.state, drawn.relaxation->Current().between));
        if (report.converged) least = std::min(least, drawn.LeastDistance());
      }
      for (int c = 0; c < drawn.state.curves(); ++c) {
        CHECK_THAT(BrokenGeometry(drawn.stack.empty_rod(c), drawn.state.curve(c)),
                   Catch::Equals(""));
      }
      CHECK(std::isfinite(drawn.relaxation->Current().energy_mJ));
    }
    const TickReport report =
        Settle(*drawn.relaxation, drawn.stack.Bounded(goal), drawn.state, 100);
    CAPTURE(layout, report.residual, report.stalled, least, passed);
    CHECK(report.arrived());
    CHECK(report.converged);
    CHECK(passed == 0);
    // The contact is as soft as the wall: stiff wires press into each other.
    CHECK(least > 0.5);
  }
}

}  // namespace
}  // namespace torquer::test
