#include "tests/support/hard_cases.h"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <sstream>
#include <utility>

#include "host/simulator/core/newton/newton_relaxation.h"
#include "host/simulator/core/paper/paper_relaxation.h"
#include "host/simulator/effects/friction.h"
#include "host/simulator/vessel/phantoms.h"
#include "tests/support/analytic_fields.h"
#include "tests/support/invariants.h"
#include "tests/support/wires.h"

namespace torquer::test {
namespace {

constexpr double kNominalRigidity = 6.35e-3;

// The phantom outlives its users here; it is built once.
const vessel::TubeVessel& Phantom() {
  static const vessel::TubeVessel vessel = vessel::MakeTyPhantom();
  return vessel;
}

std::shared_ptr<const ClearanceField> PhantomField() {
  return {std::shared_ptr<void>(), Phantom().field.get()};
}

std::vector<Vector3d> PhantomPath() {
  std::vector<Vector3d> path;
  const auto& main = Phantom().centerlines.curves()[0];
  for (double s = 0.5; s < 280; s += 0.5) path.push_back(main.At(s).position_mm);
  return path;
}

Sheath PhantomEntry() { return {Phantom().entry_point_mm(), Phantom().entry_direction()}; }

// Targets from a to b in steps.
std::vector<HandTarget> Feed(double from, double to, double step_mm, double rotation_rad = 0) {
  std::vector<HandTarget> script;
  const int count = std::max(1, static_cast<int>(std::ceil(std::abs(to - from) / step_mm)));
  for (int k = 1; k <= count; ++k) script.push_back({from + (to - from) * k / count, rotation_rad});
  return script;
}

void Append(std::vector<HandTarget> more, std::vector<HandTarget>& script) {
  script.insert(script.end(), more.begin(), more.end());
}

// A wire into the phantom, its tip curved by 45 degrees.
HardScene IntoPhantom(WireParameters p, double stiffness_N_mm2, std::vector<HandTarget> script) {
  p.sheath = PhantomEntry();
  if (p.tip_mm == 0) {
    p.tip_mm = 10;
    p.tip_curvature_1_per_mm = std::numbers::pi / 40;
  }
  return {PhantomField(), MakeWire(p), {.stiffness_N_mm2 = stiffness_N_mm2}, std::move(script)};
}

// The same with a straight tip: head-on into the T.
HardScene StraightIntoPhantom(WireParameters p, double stiffness_N_mm2,
                              std::vector<HandTarget> script) {
  p.sheath = PhantomEntry();
  return {PhantomField(), MakeWire(p), {.stiffness_N_mm2 = stiffness_N_mm2}, std::move(script)};
}

const Sheath kTorusEntry(double ring_mm) { return {Vector3d(ring_mm, 0, 0), Vector3d::UnitY()}; }

template <class... Values>
double OneOf(std::mt19937& random, Values... values) {
  const double all[] = {values...};
  return all[std::uniform_int_distribution<std::size_t>(0, sizeof...(values) - 1)(random)];
}

void AddSpeed(std::vector<HardCase>& cases) {
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
                                               std::vector<HandTarget>(6, {1000, 0}));
                     s.units = 300;
                     return s;
                   },
                   0.02});
  cases.push_back({"full insert and retract in turn",
                   [](std::mt19937& random) {
                     std::vector<HandTarget> script;
                     for (int k = 0; k < 150; ++k) {
                       script.push_back({k % 2 ? 0.0 : 150.0,
                                         std::uniform_real_distribution<double>(-3, 3)(random)});
                     }
                     HardScene s = IntoPhantom({.max_length_mm = 200}, 0.01, script);
                     s.units = static_cast<int>(OneOf(random, 7.0, 60.0, 1000.0));
                     return s;
                   },
                   0.02});
  cases.push_back({"a hand that trembles",
                   [](std::mt19937& random) {
                     std::normal_distribution<double> normal;
                     std::vector<HandTarget> script;
                     for (int k = 0; k < 120; ++k) {
                       script.push_back({120 + 5 * normal(random), 2 * normal(random)});
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
  // The stiffest perforate a wall of 0.01 N/mm^2: no bound but the lengths.
  const double none = std::numeric_limits<double>::infinity();
  for (const auto& [factor, deepest] :
       {std::pair(1e-4, 1e-4), std::pair(1e-2, 1e-3), std::pair(1e2, 0.5), std::pair(1e4, none),
        std::pair(1e6, none)}) {
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

void AddSizes(std::vector<HardCase>& cases) {
  for (const double lambda : {0.05, 0.2, 5.0, 10.0}) {
    std::ostringstream name;
    name << "segments of " << lambda << " mm";
    cases.push_back({name.str(),
                     [lambda](std::mt19937&) {
                       // The fine ones start at the T, so that they need not come all the way.
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
  for (const int n : {1, 2, 3, 10000}) {
    std::ostringstream name;
    name << "n = " << n;
    cases.push_back({name.str(),
                     [n](std::mt19937&) {
                       const double lambda = n < 10 ? 2 : 250.0 / n;
                       HardScene s =
                           IntoPhantom({.segment_mm = lambda, .max_length_mm = 260}, 0.01,
                                       n < 10 ? Feed(0, n * lambda, 0.3)
                                              : Feed(n * lambda, n * lambda + 0.02, 0.02));
                       if (n > 10) {
                         s.units = 20;
                         s.settle_ticks = 0;
                         s.start_mm = n * lambda;
                         s.start_path = PhantomPath();
                       }
                       return s;
                     },
                     0.05, n <= 1000, n <= 1000});
  }
}

void AddShapes(std::vector<HardCase>& cases) {
  cases.push_back({"a wire nearly as thick as the lumen",
                   [](std::mt19937&) {
                     const auto field = std::make_shared<Torus>(Side::kInside, 30, 2);
                     const WireModel model = MakeWire(
                         {.radius_mm = 1.95, .max_length_mm = 120, .sheath = kTorusEntry(30)});
                     return HardScene{field, model, {.stiffness_N_mm2 = 0.1}, Feed(0, 110, 1)};
                   },
                   0.01});
  cases.push_back({"a U-turn of 1.5 wire diameters",
                   [](std::mt19937&) {
                     const double ring = 3 * 0.178;
                     const auto field = std::make_shared<Torus>(Side::kInside, ring, 0.3);
                     const WireModel model = MakeWire(
                         {.segment_mm = 0.1, .max_length_mm = 6, .sheath = kTorusEntry(ring)});
                     return HardScene{field, model, {.stiffness_N_mm2 = 1}, Feed(0, 5, 0.05)};
                   },
                   0.25});
  cases.push_back({"a blind end: the wire buckles",
                   [](std::mt19937&) {
                     const auto field =
                         std::make_shared<Capsule>(Vector3d(-10, 0, 0), Vector3d(40, 0, 0), 3);
                     const WireModel model = MakeWire({.max_length_mm = 130});
                     return HardScene{field, model, {.stiffness_N_mm2 = 0.05}, Feed(0, 120, 1)};
                   },
                   0.1});
  cases.push_back({"a wire coiled up in a ball",
                   [](std::mt19937&) {
                     const auto field =
                         std::make_shared<Capsule>(Vector3d(14.8, 0, 0), Vector3d(15.2, 0, 0), 15);
                     const WireModel model = MakeWire(
                         {.tip_mm = 5, .tip_curvature_1_per_mm = 0.1, .max_length_mm = 260});
                     return HardScene{field, model, {.stiffness_N_mm2 = 0.05}, Feed(0, 250, 2)};
                   },
                   0.05});
  cases.push_back({"a jammed tip and 50 turns",
                   [](std::mt19937& random) {
                     const auto field =
                         std::make_shared<Capsule>(Vector3d(-10, 0, 0), Vector3d(30, 0, 0), 3);
                     const WireModel model = MakeWire(
                         {.tip_mm = 10, .tip_curvature_1_per_mm = 0.15, .max_length_mm = 60});
                     std::vector<HandTarget> script = Feed(0, 45, 0.5);
                     const double step = OneOf(random, 0.3, 1.0, 3.2);
                     for (double turn = 0; turn < 100 * std::numbers::pi; turn += step) {
                       script.push_back({45, turn});
                     }
                     return HardScene{field, model, {.stiffness_N_mm2 = 0.05}, script};
                   },
                   0.1});
  cases.push_back({"a tip curved by 270 degrees",
                   [](std::mt19937&) {
                     std::vector<HandTarget> script = Feed(0, 150, 1);
                     Append(Feed(150, 150.001, 0.001, 3), script);
                     Append(Feed(150, 20, 1, 3), script);
                     return IntoPhantom({.tip_mm = 10,
                                         .tip_curvature_1_per_mm = 0.15 * std::numbers::pi,
                                         .max_length_mm = 200},
                                        0.05, script);
                   },
                   0.05});
  cases.push_back(
      {"sharp edges where tubes meet",
       [](std::mt19937&) {
         static const auto sharp = [] {
           std::vector<vessel::Tube> tubes;
           for (const double side : {-1.0, 1.0}) {
             const Vector3d turn(60, 0, 0);
             tubes.push_back({side < 0 ? "left" : "right",
                              vessel::ArcLinePath::FromCorners(
                                  {Vector3d::Zero(), turn, turn + 60 * Vector3d(0.5, side, 0)}, 6),
                              {2},
                              {0}});
           }
           return std::make_shared<vessel::TubeField>(tubes, 0.0);
         }();
         std::vector<HandTarget> script = Feed(0, 110, 0.5);
         Append(Feed(110, 50, 1, 3), script);
         Append(Feed(50, 110, 1, 3), script);
         const WireModel model =
             MakeWire({.tip_mm = 8, .tip_curvature_1_per_mm = 0.1, .max_length_mm = 120});
         return HardScene{sharp, model, {.stiffness_N_mm2 = 0.05}, script};
       },
       0.05});
}

void AddStarts(std::vector<HardCase>& cases) {
  for (const double length : {20.0, 80.0, 240.0}) {
    std::ostringstream name;
    name << "a start straight through the wall, " << length << " mm long";
    cases.push_back(
        {name.str(),
         [length](std::mt19937&) {
           const auto field = std::make_shared<Torus>(Side::kInside, 40, 3);
           const WireModel model = MakeWire({.max_length_mm = 260, .sheath = kTorusEntry(40)});
           HardScene s{field, model, {.stiffness_N_mm2 = 0.05}, Feed(length, length + 5, 0.5)};
           s.start_mm = length;
           s.units = 200;
           return s;
         },
         0.05});
  }
  cases.push_back({"antiparallel neighbors",
                   [](std::mt19937&) {
                     const auto field = std::make_shared<Torus>(Side::kInside, 40, 3);
                     const WireModel model =
                         MakeWire({.max_length_mm = 100, .sheath = kTorusEntry(40)});
                     HardScene s{field, model, {.stiffness_N_mm2 = 0.05}, Feed(40, 45, 0.1)};
                     s.start_mm = 40;
                     for (int i = 0; i < 40; ++i) {
                       s.start_tangents.push_back((i / 5 % 2 ? -1 : 1) * Vector3d::UnitY());
                     }
                     return s;
                   },
                   0.05});
  cases.push_back({"a start with tangents at random",
                   [](std::mt19937& random) {
                     std::normal_distribution<double> normal;
                     HardScene s = IntoPhantom({.max_length_mm = 120}, 0.05, Feed(100, 105, 0.1));
                     s.start_mm = 100;
                     for (int i = 0; i < 100; ++i) {
                       const double x = normal(random);
                       const double y = normal(random);
                       s.start_tangents.push_back(Vector3d(x, y, normal(random)).normalized());
                     }
                     return s;
                   },
                   0.1});
}

void AddRandom(std::vector<HardCase>& cases) {
  cases.push_back({"anything at random", [](std::mt19937& random) {
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
                     std::vector<HandTarget> script;
                     HandTarget at;
                     std::normal_distribution<double> normal;
                     for (int k = 0; k < 150; ++k) {
                       const double reach = power(-2, 1.3);
                       at.insertion_mm += reach * (normal(random) + 0.3);
                       at.rotation_rad += 0.1 * reach * normal(random);
                       script.push_back(at);
                     }
                     HardScene s = IntoPhantom(p, stiffness, script);
                     s.units = static_cast<int>(power(0, 2));
                     return s;
                   }});
}

WireState StartOf(const HardScene& scene) {
  WireState state(scene.model);
  if (scene.start_mm > 0) LayAlong(scene.model, scene.start_path, scene.start_mm, state);
  for (std::size_t i = 0; i < scene.start_tangents.size() && i < state.tangents.size(); ++i) {
    state.tangents[i] = scene.start_tangents[i];
  }
  PlaceNodes(scene.model, 1, state);
  TransportNormals(scene.model, state);
  return state;
}

std::unique_ptr<Relaxation> MakeRelaxation(Way way, const HardScene& scene,
                                           const std::vector<EnergyTerm*>& terms) {
  if (way == Way::kPaper) {
    return std::make_unique<PaperRelaxation>(scene.model, *scene.field, scene.wall,
                                             PaperSettings{});
  }
  return std::make_unique<NewtonRelaxation>(scene.model, *scene.field, scene.wall, NewtonSettings{},
                                            terms);
}

}  // namespace

const char* NameOf(Way way) {
  switch (way) {
    case Way::kNewton:
      return "newton";
    case Way::kNewtonWithFriction:
      return "newton with friction";
    case Way::kPaper:
      return "paper";
  }
  return "";
}

std::vector<HardCase> HardCases() {
  std::vector<HardCase> cases;
  AddSpeed(cases);
  AddStiffness(cases);
  AddSizes(cases);
  AddShapes(cases);
  AddStarts(cases);
  AddRandom(cases);
  return cases;
}

HardOutcome RunHardCase(const HardCase& hard, Way way, unsigned seed) {
  std::mt19937 random(seed);
  HardScene scene = hard.make(random);
  if (way == Way::kPaper) scene.wall.points_per_segment = 1;
  const int points = scene.wall.points_per_segment;
  effects::Friction friction(0.1, 0.005, {scene.model, scene.wall});
  std::vector<EnergyTerm*> terms;
  if (way == Way::kNewtonWithFriction) terms.push_back(&friction);
  const std::unique_ptr<Relaxation> relaxation = MakeRelaxation(way, scene, terms);

  WireState state = StartOf(scene);
  relaxation->Restart(state);
  TickChecker checker(scene.model, *scene.field, state);
  HardOutcome outcome;
  const auto tick = [&](const HandTarget& target, int units) {
    CountedBudget budget(units);
    const TickReport report = relaxation->Tick(target, budget, state);
    const std::string broken = checker.Check(target, report, state, points);
    if (!broken.empty() && outcome.broken.empty()) {
      std::ostringstream what;
      what << "tick " << outcome.ticks << ": " << broken;
      outcome.broken = what.str();
    }
    ++outcome.ticks;
    outcome.converged += report.converged;
    outcome.snaps += report.snapped;
    outcome.deepest_mm = std::max(outcome.deepest_mm, report.max_penetration_mm);
    if (report.converged) {
      outcome.at_rest_mm = std::max(outcome.at_rest_mm, report.max_penetration_mm);
    }
    outcome.longest_work = std::max(outcome.longest_work, report.work);
    outcome.last_residual = report.residual;
    return report;
  };
  // The first ticks once more at the end: all that was in between must leave no trace.
  std::vector<std::uint64_t> first;
  for (const HandTarget& target : scene.script) {
    tick(target, scene.units);
    if (!outcome.broken.empty()) return outcome;
    if (first.size() < 5) first.push_back(HashState(state));
  }
  const HandTarget last = scene.script.back();
  for (int k = 0; k < scene.settle_ticks && !outcome.settled; ++k) {
    outcome.settled = tick(last, way == Way::kPaper ? 4 : 400).converged;
    if (!outcome.broken.empty()) return outcome;
  }
  const int most = scene.start_mm > 0 ? 1 : 2000;  // a start that was laid does not come back
  for (int k = 0; k < most && (state.insertion_mm > 0 || state.rotation_rad != 0); ++k) {
    tick({0, 0}, scene.start_mm > 0 ? scene.units : 400);
    if (!outcome.broken.empty()) return outcome;
  }
  if (scene.start_mm > 0) return outcome;
  if (HashState(state) != HashState(WireState(scene.model))) {
    outcome.broken = "drawn out and turned back, the wire is not as at the start";
    return outcome;
  }
  for (std::size_t k = 0; k < first.size(); ++k) {
    tick(scene.script[k], scene.units);
    if (HashState(state) != first[k]) {
      std::ostringstream what;
      what << "begun anew, tick " << k << " gave another state than the first time";
      outcome.broken = what.str();
      break;
    }
  }
  return outcome;
}

}  // namespace torquer::test
