// Hard cases in vessels that are made for them, and from starts that no hand makes.
#include <algorithm>
#include <memory>
#include <numbers>
#include <sstream>

#include "host/simulator/vessel/brick_field.h"
#include "host/simulator/vessel/tube_field.h"
#include "host/study/cases/analytic_fields.h"
#include "host/study/cases/case_parts.h"

namespace torquer::study {

using Eigen::Vector3d;

namespace {

const Sheath kTorusEntry(double ring_mm) { return {Vector3d(ring_mm, 0, 0), Vector3d::UnitY()}; }

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

}  // namespace

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

}  // namespace torquer::study
