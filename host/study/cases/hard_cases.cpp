#include "host/study/cases/hard_cases.h"

#include <algorithm>
#include <cassert>
#include <cmath>
#include <map>
#include <numbers>
#include <sstream>
#include <utility>

#include "host/simulator/vessel/brick_field.h"
#include "host/simulator/vessel/phantoms.h"
#include "host/study/cases/analytic_fields.h"
#include "host/study/cases/simple_wire.h"

namespace torquer::study {
namespace {

using Eigen::Vector3d;

constexpr double kNominalRigidity = 6.35e-3;

// The phantom is built once and outlives its users.
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

// Targets from `from` to `to` in equal steps of at most `step_mm`.
std::vector<InstrumentPoses> Feed(double from, double to, double step_mm, double rotation_rad = 0) {
  std::vector<InstrumentPoses> script;
  const int count = std::max(1, static_cast<int>(std::ceil(std::abs(to - from) / step_mm)));
  for (int k = 1; k <= count; ++k) {
    script.emplace_back(from + (to - from) * k / count, rotation_rad);
  }
  return script;
}

void Append(std::vector<InstrumentPoses> more, std::vector<InstrumentPoses>& script) {
  script.insert(script.end(), more.begin(), more.end());
}

// Wire into the phantom, with a tip curved by 45 degrees.
HardScene IntoPhantom(WireParameters p, double stiffness_N_mm2,
                      std::vector<InstrumentPoses> script) {
  p.sheath = PhantomEntry();
  if (p.tip_mm == 0) {
    p.tip_mm = 10;
    p.tip_curvature_1_per_mm = std::numbers::pi / 40;
  }
  return {PhantomField(), MakeWire(p), {.stiffness_N_mm2 = stiffness_N_mm2}, std::move(script)};
}

// Wire into the phantom with a straight tip: head-on into the T.
HardScene StraightIntoPhantom(WireParameters p, double stiffness_N_mm2,
                              std::vector<InstrumentPoses> script) {
  p.sheath = PhantomEntry();
  return {PhantomField(), MakeWire(p), {.stiffness_N_mm2 = stiffness_N_mm2}, std::move(script)};
}

const Sheath kTorusEntry(double ring_mm) { return {Vector3d(ring_mm, 0, 0), Vector3d::UnitY()}; }

template <class... Values>
double OneOf(std::mt19937& random, Values... values) {
  const double all[] = {values...};
  return all[std::uniform_int_distribution<std::size_t>(0, sizeof...(values) - 1)(random)];
}

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
  const auto ball = [](double tip_curvature_1_per_mm) {
    return [=](std::mt19937&) {
      const auto field = std::make_shared<Capsule>(Vector3d(14.8, 0, 0), Vector3d(15.2, 0, 0), 15);
      const WireModel model = MakeWire(
          {.tip_mm = 5, .tip_curvature_1_per_mm = tip_curvature_1_per_mm, .max_length_mm = 260});
      return HardScene{field, model, {.stiffness_N_mm2 = 0.05}, Feed(0, 250, 2)};
    };
  };
  cases.push_back({"a wire coiled up in a ball", ball(0), 0.05});
  // In a wire rigid in torsion, without friction, the coil's shape turns the tip and the tip turns
  // the coil. They may rotate forever.
  cases.push_back({.name = "a wire with a bent tip coiled up in a ball",
                   .make = ball(0.1),
                   .deepest_mm = 0.05,
                   .settles = false});
  cases.push_back({"a jammed tip and 50 turns",
                   [](std::mt19937& random) {
                     const auto field =
                         std::make_shared<Capsule>(Vector3d(-10, 0, 0), Vector3d(30, 0, 0), 3);
                     const WireModel model = MakeWire(
                         {.tip_mm = 10, .tip_curvature_1_per_mm = 0.15, .max_length_mm = 60});
                     std::vector<InstrumentPoses> script = Feed(0, 45, 0.5);
                     const double step = OneOf(random, 0.3, 1.0, 3.2);
                     for (double turn = 0; turn < 100 * std::numbers::pi; turn += step) {
                       script.emplace_back(45, turn);
                     }
                     return HardScene{field, model, {.stiffness_N_mm2 = 0.05}, script};
                   },
                   0.1});
  cases.push_back({"a tip curved by 270 degrees",
                   [](std::mt19937&) {
                     std::vector<InstrumentPoses> script = Feed(0, 150, 1);
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
         std::vector<InstrumentPoses> script = Feed(0, 110, 0.5);
         Append(Feed(110, 50, 1, 3), script);
         Append(Feed(50, 110, 1, 3), script);
         const WireModel model =
             MakeWire({.tip_mm = 8, .tip_curvature_1_per_mm = 0.1, .max_length_mm = 120});
         return HardScene{sharp, model, {.stiffness_N_mm2 = 0.05}, script};
       },
       0.05});
}

// Voxel field of a union of parts: its clearance is the largest of theirs.
template <class Function>
std::shared_ptr<const ClearanceField> Voxels(Function clearance, const Eigen::AlignedBox3d& box) {
  vessel::BrickFieldOptions options;
  options.voxel_mm = 0.25;
  return vessel::BrickField::FromFunction(clearance, box, options);
}

double InTube(const Vector3d& p, const Vector3d& a, const Vector3d& b, double radius) {
  const Vector3d ab = b - a;
  const double t = std::clamp((p - a).dot(ab) / ab.squaredNorm(), 0.0, 1.0);
  return radius - (p - a - t * ab).norm();
}

double InBox(const Vector3d& p, const Vector3d& low, const Vector3d& high) {
  return std::min((p - low).minCoeff(), (high - p).minCoeff());
}

void AddVoxels(std::vector<HardCase>& cases) {
  cases.push_back({"a septum of one voxel, head-on",
                   [](std::mt19937& random) {
                     static const auto field = Voxels(
                         [](const Vector3d& p) {
                           const double wide = InTube(p, {-5, 0, 0}, {20, 0, 0}, 4.2);
                           const double one = InTube(p, {20, 2.125, 0}, {70, 2.125, 0}, 2);
                           const double other = InTube(p, {20, -2.125, 0}, {70, -2.125, 0}, 2);
                           return std::max({wide, one, other});
                         },
                         Eigen::AlignedBox3d(Vector3d(-10, -5, -5), Vector3d(73, 5, 5)));
                     std::vector<InstrumentPoses> script = Feed(0, 70, 0.5);
                     Append(Feed(70, 30, 1, OneOf(random, -2.0, 0.5, 3.0)), script);
                     Append(Feed(30, 70, 0.5, OneOf(random, -1.0, 1.0)), script);
                     const WireModel model = MakeWire(
                         {.tip_mm = 6, .tip_curvature_1_per_mm = 0.08, .max_length_mm = 80});
                     return HardScene{field, model, {.stiffness_N_mm2 = 0.05}, script};
                   },
                   0.2});
  cases.push_back({"sharp corners, as a mesh has them",
                   [](std::mt19937&) {
                     static const auto field = Voxels(
                         [](const Vector3d& p) {
                           return std::max(InBox(p, {-5, -2, -2}, {42, 2, 2}),
                                           InBox(p, {38, -2, -2}, {42, 40, 2}));
                         },
                         Eigen::AlignedBox3d(Vector3d(-5, -2, -2), Vector3d(42, 40, 2)));
                     const WireModel model = MakeWire(
                         {.tip_mm = 6, .tip_curvature_1_per_mm = 0.15, .max_length_mm = 80});
                     std::vector<InstrumentPoses> script = Feed(0, 65, 0.5);
                     Append(Feed(65, 20, 1, 2), script);
                     Append(Feed(20, 65, 0.5, 4), script);
                     return HardScene{field, model, {.stiffness_N_mm2 = 0.05}, script};
                   },
                   0.2});
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
                       s.start_tangents.emplace_back((i / 5 % 2 ? -1 : 1) * Vector3d::UnitY());
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
      // The wire is out of reach of the wall or drawn back from it: nothing hinders the cycles.
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
      // wire with 700 times the nominal stiffness was 26 mm deep; unbent it would be 45 mm.
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
