#include "host/study/cases/hard_cases.h"

#include <algorithm>
#include <cassert>
#include <cmath>
#include <map>
#include <sstream>
#include <utility>

#include "host/study/cases/case_parts.h"

namespace torquer::study {
namespace {

void AddSpeed(Extent extent, std::vector<HardCase>& cases) {
  cases.push_back({"insertion at 1 m/s",
                   [](std::mt19937&) {
                     HardScene s = IntoPhantom({.max_length_mm = 260}, 0.01, Feed(0, 250, 1));
                     s.units = 6;
                     return s;
                   },
                   0.02});
  cases.push_back({"1 m in one command",
                   [](std::mt19937&) {
                     HardScene s = IntoPhantom({.max_length_mm = 240}, 0.01,
                                               std::vector<InstrumentPoses>(6, {1000, 0}));
                     s.units = 300;
                     return s;
                   },
                   0.02});
  cases.push_back({"full insert and retract in turn",
                   [actions = extent == Extent::kSoak ? 1000000 : 150](std::mt19937& random) {
                     std::vector<InstrumentPoses> script;
                     script.reserve(static_cast<std::size_t>(actions));
                     for (int k = 0; k < actions; ++k) {
                       // Reversals either every tick, or after enough ticks for the whole way.
                       const int half = k / 50000 % 2 == 0 ? 1 : 300;
                       script.emplace_back(k / half % 2 ? 0.0 : 150.0,
                                           std::uniform_real_distribution<double>(-3, 3)(random));
                     }
                     HardScene s = IntoPhantom({.max_length_mm = 200}, 0.01, script);
                     s.units = static_cast<int>(OneOf(random, 7.0, 60.0, 1000.0));
                     return s;
                   },
                   0.05});
  cases.push_back({"a hand that trembles",
                   [](std::mt19937& random) {
                     std::normal_distribution<double> normal;
                     std::vector<InstrumentPoses> script;
                     for (int k = 0; k < 120; ++k) {
                       const double to_mm = 120 + 5 * normal(random);
                       script.emplace_back(to_mm, 2 * normal(random));
                     }
                     return IntoPhantom({.max_length_mm = 200}, 0.01, script);
                   },
                   0.02});
}

void AddStiffness(std::vector<HardCase>& cases) {
  cases.push_back({"2.5 mm segments head-on into a T",
                   [](std::mt19937&) {
                     return StraightIntoPhantom({.segment_mm = 2.5, .max_length_mm = 200}, 0.01,
                                                Feed(0, 150, 2.5));
                   },
                   0.02});
  // The stiffest wire hardly bends: it perforates a wall of 0.01 N/mm^2 almost straight.
  using Depth = std::optional<double>;
  for (const auto& [factor, deepest] :
       {std::pair(1e-4, Depth(1e-4)), std::pair(1e-2, Depth(1e-3)), std::pair(1e2, Depth(0.5)),
        std::pair(1e4, Depth(5)), std::pair(1e6, Depth())}) {
    std::ostringstream name;
    name << "rigidity " << factor << " times nominal";
    cases.push_back({name.str(),
                     [rigidity = factor * kNominalRigidity](std::mt19937&) {
                       return StraightIntoPhantom(
                           {.rigidity_N_mm2 = rigidity, .max_length_mm = 200}, 0.01,
                           Feed(0, 130, 1));
                     },
                     deepest});
  }
  for (const auto& [stiffness, deepest] :
       {std::pair(1e-6, 4.0), std::pair(1e-3, 0.1), std::pair(1.0, 1e-3), std::pair(1e3, 1e-5)}) {
    std::ostringstream name;
    name << "wall of " << stiffness << " N/mm^2";
    cases.push_back({name.str(),
                     [k = stiffness](std::mt19937&) {
                       return IntoPhantom({.max_length_mm = 200}, k, Feed(0, 140, 1));
                     },
                     deepest});
  }
  cases.push_back(
      {"0.014-inch steel wire, tapered",
       [](std::mt19937&) {
         const Sheath entry = PhantomEntry();
         const WireModel model(1,
                               {{0, 0.01, 0.1, 0.08, 0},
                                {10, 0.02, 0.1, 0.08, 0},
                                {10.001, 0.02, 0.1, 0, 0},
                                {150, 157, 0.178, 0, 0}},
                               10, 260, BendingLaw::kExact, entry);
         return HardScene{PhantomField(), model, {.stiffness_N_mm2 = 10}, Feed(0, 250, 1)};
       },
       0.1});
}

void AddSizes(Extent extent, std::vector<HardCase>& cases) {
  for (const double lambda : {0.05, 0.2, 5.0, 10.0}) {
    std::ostringstream name;
    name << "segments of " << lambda << " mm";
    cases.push_back({name.str(),
                     [lambda](std::mt19937&) {
                       // Cases with fine segments start at the T to save the way there.
                       HardScene s =
                           IntoPhantom({.segment_mm = lambda, .max_length_mm = 160}, 0.01,
                                       lambda < 1 ? Feed(110, 112, 0.2) : Feed(0, 140, 1));
                       if (lambda < 1) {
                         s.settle_ticks = 1;
                         s.start_mm = 110;
                         s.start_path = PhantomPath();
                       }
                       return s;
                     },
                     0.05, lambda >= 0.2, lambda >= 1});
  }
  const bool soak = extent == Extent::kSoak;
  for (const int n : {1, 2, 3, 100, 1000, 2500, 10000}) {
    if (!soak && n > 3 && n < 10000) continue;
    std::ostringstream name;
    name << "n = " << n;
    cases.push_back({name.str(),
                     [n, soak](std::mt19937&) {
                       const double lambda = n < 10 ? 2 : 250.0 / n;
                       HardScene s =
                           IntoPhantom({.segment_mm = lambda, .max_length_mm = 260}, 0.01,
                                       n < 10 ? Feed(0, n * lambda, 0.3)
                                              : Feed(n * lambda, n * lambda + 0.02, 0.02));
                       if (n > 10) {
                         s.units = soak ? 200 : 20;
                         s.settle_ticks = soak ? 5 : 0;
                         s.start_mm = n * lambda;
                         s.start_path = PhantomPath();
                       }
                       return s;
                     },
                     0.05, n <= 1000, n < 10});
  }
}

void AddRandom(std::vector<HardCase>& cases) {
  cases.push_back({"anything at random",
                   [](std::mt19937& random) {
                     const auto power = [&](double low, double high) {
                       return std::pow(10,
                                       std::uniform_real_distribution<double>(low, high)(random));
                     };
                     WireParameters p;
                     p.segment_mm = power(-0.3, 0.6);
                     p.rigidity_N_mm2 = kNominalRigidity * power(-2, 3);
                     p.radius_mm = power(-1.3, 0.1);
                     p.tip_mm = OneOf(random, 0.0, 5.0, 15.0);
                     p.tip_curvature_1_per_mm = 0.2 * power(-1, 0) / std::max(1.0, p.segment_mm);
                     p.max_length_mm = 150;
                     const double stiffness = power(-3, 1);
                     std::vector<InstrumentPoses> script;
                     InstrumentPoses at;
                     std::normal_distribution<double> normal;
                     for (int k = 0; k < 150; ++k) {
                       const double reach = power(-2, 1.3);
                       at[0].insertion_mm += reach * (normal(random) + 0.3);
                       at[0].rotation_rad += 0.1 * reach * normal(random);
                       script.push_back(at);
                     }
                     HardScene s = IntoPhantom(p, stiffness, script);
                     s.units = static_cast<int>(power(0, 2));
                     const double curvature = p.tip_curvature_1_per_mm;
                     s.tip_stands_off_mm = (1 - std::cos(curvature * p.tip_mm)) / curvature;
                     return s;
                   },
                   // The wall is no softer and the wire no stiffer than in "rigidity 10000 times
                   // nominal". That case is 2.9 mm deep with a straight tip.
                   6.0});
}

// Sets the cases in which the paper's method differs from the default PaperExpectation.
void AddPaper(std::vector<HardCase>& cases) {
  const std::map<std::string, PaperExpectation> rows = {
      // The wire does not reach the wall, or is drawn back from it, so the cycles are not
      // disturbed.
      {"full insert and retract in turn", {.settles = true}},
      {"n = 1", {.deepest_mm = 0.0, .settles = true}},
      {"n = 2", {.deepest_mm = 0.0, .settles = true}},
      {"n = 3", {.deepest_mm = 0.0, .settles = true}},
      {"a septum of one voxel, head-on", {.deepest_mm = 1e-3, .settles = true}},
      // A wire laid in exact folds has no torque and stays folded.
      {"antiparallel neighbors", {.deepest_mm = 1e-3, .settles = true}},
      // Against a soft wall the cycles converge fast; Newton's method gives the same depth.
      {"wall of 1e-06 N/mm^2", {.deepest_mm = 4, .settles = true}},
      {"wall of 0.001 N/mm^2", {.deepest_mm = 0.1, .settles = true}},
      // A few cycles do not reach equilibrium: coarse or stiff joints turn little in each cycle.
      {"segments of 10 mm", {.deepest_mm = 1}},
      {"rigidity 100 times nominal", {.deepest_mm = 1}},
      // Head-on there is no transverse force, so (16) to (19) leave the wire unchanged: it
      // perforates.
      {"a blind end: the wire buckles", {.deepest_mm = {}, .settles = true}},
      {"a wire coiled up in a ball", {.deepest_mm = {}, .settles = true}},
      {"rigidity 10000 times nominal", {.deepest_mm = {}}},
      {"rigidity 1e+06 times nominal", {.deepest_mm = {}, .settles = true}},
      // A wire laid through the wall does not come back far enough in the given time.
      {"a start straight through the wall, 80 mm long", {.deepest_mm = {}}},
      {"a start straight through the wall, 240 mm long", {.deepest_mm = {}}},
      {"a start with tangents at random", {.deepest_mm = {}}},
      // As for Newton: "rigidity 10000 times nominal" is 8.6 mm deep. With two cycles per tick, a
      // wire of 700 times the nominal stiffness was 26 mm deep. Unbent it would be 45 mm deep.
      {"anything at random", {.deepest_mm = 15, .or_unbent = true}},
  };
  std::size_t used = 0;
  for (HardCase& hard : cases) {
    const auto row = rows.find(hard.name);
    if (row == rows.end()) continue;
    hard.paper = row->second;
    ++used;
  }
  assert(used == rows.size() && "a row names no case");
  static_cast<void>(used);
}

}  // namespace

std::vector<HardCase> HardCases(Extent extent) {
  std::vector<HardCase> cases;
  AddSpeed(extent, cases);
  AddStiffness(cases);
  AddSizes(extent, cases);
  AddShapes(cases);
  AddVoxels(cases);
  AddStarts(cases);
  AddRandom(cases);
  AddPaper(cases);
  return cases;
}

}  // namespace torquer::study
