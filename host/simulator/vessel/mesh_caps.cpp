#include "host/simulator/vessel/mesh_caps.h"

#include <algorithm>
#include <cmath>
#include <map>
#include <utility>
#include <vector>

#include "host/simulator/vessel/mesh_edges.h"
#include "host/simulator/vessel/mesh_repair.h"
#include "host/support/error.h"

namespace torquer::vessel::repair {

using Eigen::Vector3d;

namespace {

// Loops of a smaller radius are holes, not ends of vessels.
constexpr double kSmallestOpeningMm = 0.4;
// Largest root mean square distance of an opening's rim from its plane, as a share of its radius.
constexpr double kLeastFlat = 0.25;
// Largest square of a rim's length over that of a circle of the same area. Ends cut 75 degrees off
// square have 1.8, ragged ones up to 2.
constexpr double kLeastRound = 2.2;
// A rim is a hole if the mean cosine between its cap and the wall about it exceeds this.
constexpr double kLikeWall = 0.7;
// Largest area of all holes together, in areas of the largest allowed hole.
constexpr double kManyHoles = 5;

// Boundary loops as vertices, in the direction of their caps: opposite to their triangles.
std::vector<std::vector<int32_t>> BoundaryLoops(const TriangleMesh& mesh) {
  std::multimap<int32_t, int32_t> onward;
  for (const auto& [edge, uses] : EdgeTable(mesh)) {
    if (uses.size() != 1) continue;
    if (uses[0].forward) {
      onward.emplace(edge.second, edge.first);
    } else {
      onward.emplace(edge.first, edge.second);
    }
  }
  std::vector<std::vector<int32_t>> loops;
  std::vector<int32_t> way;
  while (!onward.empty() || !way.empty()) {
    if (way.empty()) way.push_back(onward.begin()->first);
    const auto step = onward.find(way.back());
    // A border that runs into an edge of several faces is the border of a sheet, which gets no cap.
    if (step == onward.end()) {
      way.pop_back();
      continue;
    }
    const int32_t to = step->second;
    onward.erase(step);
    const auto before = std::find(way.begin(), way.end(), to);
    if (before == way.end()) {
      way.push_back(to);
      continue;
    }
    // A way that meets itself closes a loop and continues from there.
    loops.emplace_back(before, way.end());
    way.erase(before + 1, way.end());
  }
  return loops;
}

// Boundary loop, with the measures that distinguish an end of a vessel from a hole in its wall.
struct Rim {
  Vector3d center_mm = Vector3d::Zero();
  Vector3d outward;  // unit
  double length_mm = 0, radius_mm = 0, off_plane_mm = 0;
  double fan_mm2 = 0;    // area of the fan that closes it
  double roundness = 0;  // square of its length over that of a circle of the same area
  bool is_end = false;
};

Rim Measure(const TriangleMesh& mesh, const std::vector<int32_t>& loop,
            const std::map<Edge, Vector3d>& normals) {
  const size_t count = loop.size();
  Rim rim;
  const auto corner = [&](size_t i) { return mesh.vertices_mm[loop[i % count]]; };
  for (size_t i = 0; i < count; ++i) {
    const double length = (corner(i + 1) - corner(i)).norm();
    rim.center_mm += (corner(i) + corner(i + 1)) / 2 * length;
    rim.length_mm += length;
  }
  rim.center_mm /= rim.length_mm;
  Vector3d area = Vector3d::Zero();
  for (size_t i = 0; i < count; ++i) {
    const Vector3d piece = (corner(i) - rim.center_mm).cross(corner(i + 1) - rim.center_mm) / 2;
    area += piece;
    rim.fan_mm2 += piece.norm();
  }
  rim.radius_mm = std::sqrt(area.norm() / M_PI);
  rim.outward = area.normalized();
  // The wall about a hole faces the way of its cap; the wall at an end faces across it.
  double alike = 0;
  for (size_t i = 0; i < count; ++i) {
    rim.off_plane_mm += std::pow(rim.outward.dot(corner(i) - rim.center_mm), 2);
    alike += (corner(i + 1) - corner(i)).norm() *
             rim.outward.dot(normals.at(std::minmax(loop[i], loop[(i + 1) % count])));
  }
  rim.off_plane_mm = std::sqrt(rim.off_plane_mm / static_cast<double>(count));
  rim.roundness = rim.length_mm * rim.length_mm / (4 * M_PI * area.norm());
  rim.is_end = rim.radius_mm >= kSmallestOpeningMm && alike <= kLikeWall * rim.length_mm &&
               rim.off_plane_mm <= kLeastFlat * rim.radius_mm && rim.roundness <= kLeastRound;
  return rim;
}

// The first measure by which a rim is not an end of a vessel.
std::string WhyNoEnd(const Rim& rim) {
  if (rim.radius_mm < kSmallestOpeningMm) {
    return "its radius is " + Number(rim.radius_mm) + " mm, and that of an end at least " +
           Number(kSmallestOpeningMm) + " mm";
  }
  if (rim.off_plane_mm > kLeastFlat * rim.radius_mm) {
    return "not flat: " + Number(rim.off_plane_mm) + " mm off a plane";
  }
  if (rim.roundness > kLeastRound) {
    return "not round: " + Number(rim.roundness) +
           " times the squared perimeter of a circle of equal area";
  }
  return "the wall around it faces as its cap does";
}

void Cap(TriangleMesh& mesh, const std::vector<int32_t>& loop, const Vector3d& center_mm) {
  if (loop.size() == 3) {
    mesh.triangles.push_back({loop[0], loop[1], loop[2]});
    return;
  }
  const auto middle = static_cast<int32_t>(mesh.vertices_mm.size());
  mesh.vertices_mm.push_back(center_mm);
  for (size_t i = 0; i < loop.size(); ++i) {
    mesh.triangles.push_back({loop[i], loop[(i + 1) % loop.size()], middle});
  }
}

}  // namespace

void CapLoops(TriangleMesh& mesh, const std::string& name, double largest_hole_share,
              MeshReport& report) {
  std::map<Edge, Vector3d> normals;  // of the faces at the border
  for (const auto& [edge, uses] : EdgeTable(mesh)) {
    if (uses.size() != 1) continue;
    normals[edge] = mesh.DoubleArea(uses[0].triangle).normalized();
  }
  const double largest_mm2 = largest_hole_share * mesh.Area();
  std::vector<Rim> holes;
  for (const auto& loop : BoundaryLoops(mesh)) {
    const Rim rim = Measure(mesh, loop, normals);
    if (!rim.is_end && rim.fan_mm2 > largest_mm2) {
      throw UserError(
          name + ": a hole with a rim of " + std::to_string(loop.size()) + " edges, " +
          Number(rim.length_mm) + " mm long, at " + Place(rim.center_mm) +
          " is not an end of a vessel (" + WhyNoEnd(rim) + ") and too large to be closed (" +
          Number(rim.fan_mm2) + " mm^2; at most " + Number(largest_mm2) +
          "); part of the surface is missing: fill the hole, or " +
          (rim.radius_mm < kSmallestOpeningMm ? "declare another mesh_unit if the vessel is wider"
                                              : "cut the vessel perpendicular to its axis"));
    }
    Cap(mesh, loop, rim.center_mm);
    if (rim.is_end) {
      report.openings.push_back({rim.center_mm, rim.outward, rim.radius_mm, -rim.outward});
    } else {
      holes.push_back(rim);
    }
  }
  report.holes_closed += holes.size();
  double closed_mm2 = 0;
  for (const Rim& hole : holes) closed_mm2 += hole.fan_mm2;
  if (closed_mm2 > kManyHoles * largest_mm2) {
    throw UserError(name + ": " + Count(holes.size(), "hole", "holes") + " in the wall, of " +
                    Number(closed_mm2) + " mm^2 together, the first at " +
                    Place(holes.front().center_mm) +
                    "; too much of the surface is missing, or its faces do not share their "
                    "vertices: export it again");
  }
  if (!holes.empty()) {
    const auto largest =
        std::max_element(holes.begin(), holes.end(),
                         [](const Rim& a, const Rim& b) { return a.fan_mm2 < b.fan_mm2; });
    report.findings.push_back(Count(holes.size(), "hole in the wall", "holes in the wall") +
                              " closed, the largest of " + Number(largest->fan_mm2) + " mm^2 at " +
                              Place(largest->center_mm) + ".");
  }
}

}  // namespace torquer::vessel::repair
