// Rest shapes of the shaped devices of host/devices, in free space: angles and sizes. A stiff wire
// in the lumen leaves a share of each angle.
#include <algorithm>
#include <catch2/catch.hpp>
#include <cmath>
#include <numbers>
#include <string>
#include <utility>
#include <vector>

#include "host/simulator/scene/device_library.h"
#include "tests/support/free_stack.h"

using namespace torquer::scene;
using torquer::WireModel;
using torquer::WireSection;
using torquer::test::FreeStack;
using torquer::test::Vector2d;
using torquer::test::Vector3d;

namespace {

constexpr double kSegmentMm = 0.5;
constexpr double kLengthMm = 220;
constexpr double kDegPerRad = 180 / std::numbers::pi;

// Two places on a device with the angle in between, positive towards the first normal.
struct Bend {
  double distal_mm;  // from the tip, in a straight part
  double proximal_mm;
  double angle_deg;
};

struct Shape {
  std::string device;
  std::vector<Bend> bends;
};

// The angles are those that the files state.
const std::vector<Shape> kShapes = {
    {"diagnostic_5f_judkins_left_4", {{5, 30, 90}, {30, 100, 180}}},
    {"diagnostic_5f_judkins_right_4", {{5, 20, 90}, {20, 100, 30}}},
    {"diagnostic_5f_cobra_2", {{4, 20, 60}, {20, 59.5, 85}, {59.5, 120, -35}}},
    {"diagnostic_4f_cobra_2", {{4, 20, 60}, {20, 59.5, 85}, {59.5, 120, -35}}},
    {"diagnostic_5f_simmons_1", {{2.5, 30, -70}, {30, 100, 195}}},
    {"diagnostic_5f_simmons_2", {{3, 50, -70}, {50, 140, 195}}},
    {"diagnostic_5f_pigtail", {{0, 60, 330}}},
    {"diagnostic_5f_vertebral", {{4, 30, 45}}},
    {"diagnostic_4f_vertebral", {{4, 30, 45}}},
    {"diagnostic_5f_multipurpose", {{10, 60, 60}}},
    {"j_wire_035", {{0, 30, 180}}},
    {"angled_hydrophilic_035", {{1.5, 30, 45}}},
};

std::vector<WireSection> SectionsOf(const std::string& device) {
  return MakeSections(ReadDevice(device).instrument);
}

// Nodes of the relaxed devices in the plane of their bends. The tip of the farthest device comes
// first. The axes are the sheath and the first normal. `insertions_mm`: one for each device.
std::vector<Vector2d> RelaxedNodes(const std::vector<std::string>& devices,
                                   const std::vector<double>& insertions_mm) {
  std::vector<WireModel> models;
  torquer::InstrumentPoses poses(static_cast<int>(devices.size()));
  for (std::size_t k = 0; k < devices.size(); ++k) {
    models.emplace_back(kSegmentMm, SectionsOf(devices[k]), 0, kLengthMm + 100,
                        torquer::BendingLaw::kExact, torquer::Sheath());
    poses[static_cast<int>(k)] = {insertions_mm[k], 0};
  }
  FreeStack free(std::move(models));
  // Straight at first, at full length.
  free.state = torquer::WireState::Along(free.stack.empty_rod(), {}, poses);
  free.relaxation->Restart(free.state);
  free.MoveTo(poses);
  const Vector3d along = free.stack.empty_rod().sheath().direction;
  const Vector3d across = free.stack.empty_rod().sheath_normal();
  std::vector<Vector2d> nodes;
  for (const Vector3d& node : free.state.nodes()) {
    nodes.emplace_back(node.dot(along), node.dot(across));
    CHECK(std::abs(node.dot(along.cross(across))) < 1e-6);
  }
  std::reverse(nodes.begin(), nodes.end());
  return nodes;
}

// Direction of the segment nearest to a place, as an angle from the sheath's direction.
double AngleDeg(const std::vector<Vector2d>& nodes, double from_tip_mm) {
  const auto k = static_cast<std::size_t>(from_tip_mm / kSegmentMm);
  const Vector2d segment = nodes[k] - nodes[k + 1];
  return kDegPerRad * std::atan2(segment[1], segment[0]);
}

// Difference of two angles, at most half a turn.
double ApartDeg(double a_deg, double b_deg) { return std::remainder(a_deg - b_deg, 360); }

// Nodes of the rest shape, the tip first, relative to the last node. They are integrals of the
// curvature by the midpoint rule, without the solver.
std::vector<Vector2d> IntegratedPlaces(const std::vector<WireSection>& sections,
                                       std::size_t count) {
  constexpr int kSteps = 50;  // in a segment
  std::vector<Vector2d> places(count);
  double angle = 0;
  Vector2d place = {0, 0};
  const double step_mm = kSegmentMm / kSteps;
  for (std::size_t k = count; k-- > 0;) {
    places[k] = place;
    if (k == 0) break;
    for (int j = kSteps; j-- > 0;) {
      const double middle_mm = kSegmentMm * static_cast<double>(k - 1) + (j + 0.5) * step_mm;
      const double turn = step_mm * torquer::SectionAt(sections, middle_mm).curvature_1_per_mm;
      place += step_mm * Vector2d(std::cos(angle + turn / 2), std::sin(angle + turn / 2));
      angle += turn;
    }
  }
  return places;
}

// Angle of a bend that a straight wire of rigidity `wire_N_mm2` leaves. The catheter's moment and
// that of the wire balance, so the curvature falls by EI over the sum of both. EI is linear between
// sections and the curvature constant, so the integral has a closed form.
double AngleLeftDeg(const std::vector<WireSection>& sections, const Bend& bend, double wire_N_mm2) {
  double left_rad = 0;
  for (std::size_t k = 1; k < sections.size(); ++k) {
    const WireSection& a = sections[k - 1];
    const WireSection& b = sections[k];
    const double length_mm = b.from_tip_mm - a.from_tip_mm;
    if (a.from_tip_mm < bend.distal_mm || b.from_tip_mm > bend.proximal_mm) continue;
    if (a.curvature_1_per_mm != b.curvature_1_per_mm) continue;  // a step
    const double growth = b.rigidity_N_mm2 - a.rigidity_N_mm2;
    const double together = a.rigidity_N_mm2 + wire_N_mm2;
    const double share = growth == 0 ? a.rigidity_N_mm2 / together
                                     : 1 - wire_N_mm2 / growth * std::log1p(growth / together);
    left_rad += share * length_mm * a.curvature_1_per_mm;
  }
  return kDegPerRad * left_rad;
}

}  // namespace

TEST_CASE("A shaped device rests in the angles that its file states", "[scene]") {
  const Shape shape = GENERATE(from_range(kShapes));
  INFO(shape.device);
  const auto sections = SectionsOf(shape.device);
  const auto nodes = RelaxedNodes({shape.device}, {kLengthMm});
  for (const Bend& bend : shape.bends) {
    CAPTURE(bend.distal_mm, bend.proximal_mm);
    const double angle_deg = AngleDeg(nodes, bend.distal_mm) - AngleDeg(nodes, bend.proximal_mm);
    // The last segment of an arc points where the middle of the segment does.
    const double curvature_per_mm = sections.front().curvature_1_per_mm;
    const double end_deg = bend.distal_mm > 0 ? 0 : kDegPerRad * curvature_per_mm * kSegmentMm / 2;
    CHECK(std::abs(ApartDeg(angle_deg + end_deg, bend.angle_deg)) < 0.3);
  }
  const auto places = IntegratedPlaces(sections, nodes.size());
  double largest_mm = 0;
  for (std::size_t k = 0; k < nodes.size(); ++k) {
    largest_mm = std::max(largest_mm, (nodes[k] - nodes.back() - places[k]).norm());
  }
  CAPTURE(largest_mm);
  CHECK(largest_mm < 0.05);
}

TEST_CASE("Loops and arms of shaped devices have the sizes that their files state", "[scene]") {
  const auto across = [](const std::vector<Vector2d>& nodes, double from_mm, double to_mm) {
    double largest_mm = 0;
    for (auto a = from_mm; a <= to_mm; a += kSegmentMm) {
      for (auto b = from_mm; b <= to_mm; b += kSegmentMm) {
        const auto& p = nodes[static_cast<std::size_t>(a / kSegmentMm)];
        const auto& q = nodes[static_cast<std::size_t>(b / kSegmentMm)];
        largest_mm = std::max(largest_mm, (p - q).norm());
      }
    }
    return largest_mm;
  };
  const auto pigtail = RelaxedNodes({"diagnostic_5f_pigtail"}, {kLengthMm});
  CHECK(across(pigtail, 0, 34) == Approx(12).margin(0.1));
  const auto j_wire = RelaxedNodes({"j_wire_035"}, {kLengthMm});
  CHECK(across(j_wire, 0, 9.25) == Approx(2 * 3).margin(0.05));
  const auto simmons_1 = RelaxedNodes({"diagnostic_5f_simmons_1"}, {kLengthMm});
  CHECK(across(simmons_1, 45.5, 72.25) == Approx(2 * 8).margin(0.1));
  const auto simmons_2 = RelaxedNodes({"diagnostic_5f_simmons_2"}, {kLengthMm});
  CHECK(across(simmons_2, 72.5, 106.25) == Approx(2 * 10).margin(0.1));
  // The tip of the left Judkins catheter points across the shaft, 40 mm below the top.
  const auto judkins = RelaxedNodes({"diagnostic_5f_judkins_left_4"}, {kLengthMm});
  double top_mm = 0;
  for (const Vector2d& node : judkins) top_mm = std::max(top_mm, node[0]);
  CHECK(top_mm - judkins.front()[0] == Approx(40).margin(0.1));
}

TEST_CASE("A stiff wire in the lumen leaves the share of a bend that both rigidities give",
          "[scene]") {
  const Shape shape = GENERATE(from_range(kShapes));
  if (ReadDevice(shape.device).kind != DeviceSpec::Kind::kCatheter) return;
  const std::string wire = GENERATE("amplatz", "amplatz_super_stiff");
  INFO(wire << " in " << shape.device);
  constexpr double kAheadMm = 60;  // here the wire's stiff shaft begins
  const double wire_N_mm2 = ReadDevice(wire).instrument.rigidity_N_mm2.back();
  const auto nodes = RelaxedNodes({wire, shape.device}, {kLengthMm, kLengthMm - kAheadMm});
  for (const Bend& bend : shape.bends) {
    CAPTURE(bend.distal_mm, bend.proximal_mm);
    const double angle_deg = AngleDeg(nodes, kAheadMm + bend.distal_mm - kSegmentMm) -
                             AngleDeg(nodes, kAheadMm + bend.proximal_mm);
    const double left_deg = AngleLeftDeg(SectionsOf(shape.device), bend, wire_N_mm2);
    CHECK(angle_deg == Approx(left_deg).margin(0.1));
    CHECK(std::abs(left_deg) < 0.25 * std::abs(bend.angle_deg));
  }
}

TEST_CASE("Shaped catheters have the tube of the straight one of their size", "[scene]") {
  for (const Shape& shape : kShapes) {
    INFO(shape.device);
    const DeviceSpec shaped = ReadDevice(shape.device);
    if (shaped.kind != DeviceSpec::Kind::kCatheter) continue;
    const DeviceSpec straight =
        ReadDevice(shape.device.substr(0, std::string("diagnostic_5f").size()));
    CHECK(shaped.instrument.radius_mm == straight.instrument.radius_mm);
    CHECK(shaped.instrument.inner_radius_mm == straight.instrument.inner_radius_mm);
    CHECK(shaped.instrument.linear_density_g_m == straight.instrument.linear_density_g_m);
    for (double s = 0; s < 200; s += 0.7) {
      CAPTURE(s);
      // Files store three digits.
      CHECK(torquer::SectionAt(MakeSections(shaped.instrument), s).rigidity_N_mm2 ==
            Approx(torquer::SectionAt(MakeSections(straight.instrument), s).rigidity_N_mm2)
                .epsilon(0.005));
    }
  }
}
