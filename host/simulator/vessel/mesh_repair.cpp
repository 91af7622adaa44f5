#include "host/simulator/vessel/mesh_repair.h"

#include <algorithm>
#include <array>
#include <cassert>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <map>
#include <numeric>
#include <set>
#include <span>
#include <utility>

#include "host/simulator/vessel/mesh_edges.h"
#include "host/simulator/vessel/vertex_welder.h"
#include "host/support/error.h"

namespace torquer::vessel::repair {

using Eigen::Vector3d;

namespace {

constexpr double kNegligibleArea = 1e-3;

void Keep(TriangleMesh& mesh, const std::vector<char>& keep) {
  size_t kept = 0;
  for (size_t i = 0; i < mesh.triangles.size(); ++i) {
    if (keep[i]) mesh.triangles[kept++] = mesh.triangles[i];
  }
  mesh.triangles.resize(kept);
}

}  // namespace

std::string Count(size_t count, const std::string& singular, const std::string& plural) {
  return std::to_string(count) + " " + (count == 1 ? singular : plural);
}

std::string Number(double value) {
  char text[32];
  std::snprintf(text, sizeof text, "%.4g", value);
  return text;
}

std::string Direction(const Vector3d& unit) {
  std::string text;
  for (const double component : unit) {
    // Adding zero removes the sign of a negative zero.
    text += (text.empty() ? "(" : ", ") + Number(std::round(1000 * component) / 1000 + 0.0);
  }
  return text + ")";
}

std::string Place(const Vector3d& point_mm) {
  char text[96];
  std::snprintf(text, sizeof text, "(%.1f, %.1f, %.1f) mm", point_mm.x(), point_mm.y(),
                point_mm.z());
  return text;
}

void DropUnusedVertices(TriangleMesh& mesh) {
  std::vector<int32_t> moved(mesh.vertices_mm.size(), -1);
  std::vector<Vector3d> kept;
  for (auto& triangle : mesh.triangles) {
    for (int32_t& vertex : triangle) {
      if (moved[vertex] < 0) {
        moved[vertex] = static_cast<int32_t>(kept.size());
        kept.push_back(mesh.vertices_mm[vertex]);
      }
      vertex = moved[vertex];
    }
  }
  mesh.vertices_mm = std::move(kept);
}

void Weld(TriangleMesh& mesh, double tolerance_mm, MeshReport& report) {
  VertexWelder welder(tolerance_mm);
  std::vector<int32_t> moved;
  moved.reserve(mesh.vertices_mm.size());
  for (const Vector3d& vertex : mesh.vertices_mm) moved.push_back(welder.Add(vertex));
  report.vertices_welded += mesh.vertices_mm.size() - welder.points_mm().size();
  mesh.vertices_mm = welder.Take();
  for (auto& triangle : mesh.triangles) {
    for (int32_t& vertex : triangle) vertex = moved[vertex];
  }
}

void DropUseless(TriangleMesh& mesh, MeshReport& report) {
  size_t degenerate = 0, doubled = 0;
  std::vector<char> keep(mesh.triangles.size(), 1);
  std::map<std::array<int32_t, 3>, size_t> seen;
  for (size_t i = 0; i < mesh.triangles.size(); ++i) {
    std::array<int32_t, 3> sorted = mesh.triangles[i];
    std::sort(sorted.begin(), sorted.end());
    if (sorted[0] == sorted[1] || sorted[1] == sorted[2]) {
      keep[i] = 0;
      ++degenerate;
      continue;
    }
    const auto [first, is_new] = seen.try_emplace(sorted, i);
    if (is_new) continue;
    keep[i] = 0;
    ++doubled;
  }
  Keep(mesh, keep);
  report.triangles_dropped += degenerate + doubled;
  if (degenerate > 0) {
    report.findings.push_back(Count(degenerate, "triangle", "triangles") +
                              " without area after welding, left out.");
  }
  if (doubled > 0) {
    report.findings.push_back(Count(doubled, "triangle", "triangles") +
                              " that duplicate another, left out.");
  }
}

std::vector<int> Parts(const TriangleMesh& mesh, int* count) {
  return Parts(mesh, EdgeTable(mesh), count);
}

std::vector<int> Parts(const TriangleMesh& mesh, const EdgeTable& edges, int* count) {
  std::vector<int32_t> parent(mesh.triangles.size());
  std::iota(parent.begin(), parent.end(), 0);
  const auto root = [&](int32_t i) {
    while (parent[i] != i) i = parent[i] = parent[parent[i]];
    return i;
  };
  for (const auto& [edge, uses] : edges) {
    if (uses.size() == 2) parent[root(uses[0].triangle)] = root(uses[1].triangle);
  }
  std::vector<int> part(mesh.triangles.size()), number(mesh.triangles.size(), -1);
  *count = 0;
  for (size_t i = 0; i < part.size(); ++i) {
    int& n = number[root(static_cast<int32_t>(i))];
    if (n < 0) n = (*count)++;
    part[i] = n;
  }
  return part;
}

EdgeFaults FindEdgeFaults(const TriangleMesh& mesh) {
  EdgeFaults faults;
  for (const auto& [edge, uses] : EdgeTable(mesh)) {
    if (uses.size() == 1) faults.open.push_back({edge.first, edge.second});
    if (uses.size() > 2) faults.several.push_back({edge.first, edge.second});
    if (uses.size() == 2 && uses[0].forward == uses[1].forward) ++faults.disagreeing;
  }
  return faults;
}

void DropFragments(TriangleMesh& mesh, MeshReport& report) {
  int count = 0;
  const std::vector<int> part = Parts(mesh, &count);
  std::vector<double> area(count, 0);
  std::vector<Vector3d> somewhere(count);
  for (size_t i = 0; i < part.size(); ++i) {
    area[part[i]] += mesh.DoubleArea(i).norm() / 2;
    somewhere[part[i]] = mesh.Centroid(i);
  }
  const double least = kNegligibleArea * *std::max_element(area.begin(), area.end());
  std::vector<char> keep(part.size(), 1);
  size_t fragments = 0, triangles = 0;
  Vector3d where = Vector3d::Zero();
  for (int p = 0; p < count; ++p) {
    if (area[p] >= least) continue;
    if (fragments++ == 0) where = somewhere[p];
  }
  for (size_t i = 0; i < part.size(); ++i) {
    if (area[part[i]] >= least) continue;
    keep[i] = 0;
    ++triangles;
  }
  if (fragments == 0) return;
  Keep(mesh, keep);
  report.triangles_dropped += triangles;
  report.findings.push_back(Count(fragments, "fragment", "fragments") + " (" +
                            Count(triangles, "triangle", "triangles") + ", the first at " +
                            Place(where) + ") too small to be a vessel, left out.");
}

void Orient(TriangleMesh& mesh, const std::string& name, MeshReport& report) {
  const EdgeTable edges(mesh);
  struct Neighbor {
    int32_t triangle;
    bool agrees;
  };
  std::vector<std::vector<Neighbor>> neighbors(mesh.triangles.size());
  for (const auto& [edge, uses] : edges) {
    if (uses.size() != 2) continue;
    const bool agrees = uses[0].forward != uses[1].forward;
    neighbors[uses[0].triangle].push_back({uses[1].triangle, agrees});
    neighbors[uses[1].triangle].push_back({uses[0].triangle, agrees});
  }
  std::vector<signed char> turn(mesh.triangles.size(), -1);
  for (size_t start = 0; start < turn.size(); ++start) {
    if (turn[start] >= 0) continue;
    std::vector<int32_t> members{static_cast<int32_t>(start)};
    turn[start] = 0;
    for (size_t next = 0; next < members.size(); ++next) {
      const int32_t i = members[next];
      for (const Neighbor& neighbor : neighbors[i]) {
        const signed char wanted = neighbor.agrees ? turn[i] : static_cast<signed char>(!turn[i]);
        if (turn[neighbor.triangle] < 0) {
          turn[neighbor.triangle] = wanted;
          members.push_back(neighbor.triangle);
        } else if (turn[neighbor.triangle] != wanted) {
          throw UserError(name + ": the surface has one side only (like a Moebius strip) near " +
                          Place(mesh.Centroid(neighbor.triangle)) +
                          "; it encloses no lumen: repair it there");
        }
      }
    }
    size_t turned = 0;
    for (const int32_t i : members) turned += turn[i];
    const bool majority = 2 * turned > members.size();
    for (const int32_t i : members) turn[i] = turn[i] != static_cast<signed char>(majority);
  }
  size_t turned = 0;
  for (size_t i = 0; i < turn.size(); ++i) {
    if (!turn[i]) continue;
    std::swap(mesh.triangles[i][1], mesh.triangles[i][2]);
    ++turned;
  }
  report.triangles_turned += turned;
  if (turned > 0) {
    report.findings.push_back(Count(turned, "triangle", "triangles") +
                              " oriented against their neighbors, flipped.");
  }
}

void MendSlivers(TriangleMesh& mesh, double tolerance_mm, MeshReport& report) {
  constexpr int kPasses = 5;
  size_t repaired = 0;
  for (int pass = 0; pass < kPasses; ++pass) {
    const EdgeTable edges(mesh);
    std::vector<char> touched(mesh.triangles.size(), 0);
    size_t now = 0;
    for (size_t i = 0; i < mesh.triangles.size(); ++i) {
      int longest = 0;
      double length = 0;
      for (int corner = 0; corner < 3; ++corner) {
        const double l = (mesh.Corner(i, (corner + 1) % 3) - mesh.Corner(i, corner)).norm();
        if (l > length) {
          length = l;
          longest = corner;
        }
      }
      if (touched[i] || mesh.DoubleArea(i).norm() > tolerance_mm * length) continue;
      const auto triangle = mesh.triangles[i];
      const int32_t a = triangle[longest], b = triangle[(longest + 1) % 3],
                    c = triangle[(longest + 2) % 3];
      const auto uses = edges.UsesOf(std::minmax(a, b));
      if (uses.size() != 2) continue;
      const EdgeUse& other = uses[0].triangle == static_cast<int32_t>(i) ? uses[1] : uses[0];
      if (touched[other.triangle]) continue;
      const int32_t d = mesh.triangles[other.triangle][(other.corner + 2) % 3];
      // The new edge must not exist already.
      if (d == c || !edges.UsesOf(std::minmax(c, d)).empty()) continue;
      mesh.triangles[i] = {a, d, c};
      mesh.triangles[other.triangle] = {d, b, c};
      touched[i] = touched[other.triangle] = 1;
      ++now;
    }
    repaired += now;
    if (now == 0) break;
  }
  report.slivers_repaired += repaired;
  if (repaired > 0) {
    report.findings.push_back(Count(repaired, "sliver", "slivers") +
                              " repaired by flipping an edge.");
  }
}

void PointOutward(TriangleMesh& mesh, MeshReport& report) {
  const EdgeTable edges(mesh);
  int count = 0;
  const std::vector<int> part = Parts(mesh, edges, &count);
  // Middle of an open part's border: from there, the sign of its volume shows the side to which it
  // bulges. For a closed part any point is suitable.
  std::vector<Vector3d> about(count, Vector3d::Zero());
  std::vector<double> border(count, 0);
  for (const auto& [edge, uses] : edges) {
    if (uses.size() == 2) continue;
    const Vector3d &a = mesh.vertices_mm[edge.first], &b = mesh.vertices_mm[edge.second];
    const double length = (b - a).norm();
    for (const EdgeUse& use : uses) {
      about[part[use.triangle]] += length * (a + b) / 2;
      border[part[use.triangle]] += length;
    }
  }
  for (int p = 0; p < count; ++p) {
    about[p] = border[p] > 0 ? Vector3d(about[p] / border[p]) : mesh.Corner(0, 0);
  }
  std::vector<double> volume(count, 0);
  for (size_t i = 0; i < part.size(); ++i) {
    const Vector3d& from = about[part[i]];
    volume[part[i]] +=
        (mesh.Corner(i, 0) - from).dot((mesh.Corner(i, 1) - from).cross(mesh.Corner(i, 2) - from)) /
        6;
  }
  size_t turned = 0;
  for (size_t i = 0; i < part.size(); ++i) {
    if (volume[part[i]] >= 0) continue;
    std::swap(mesh.triangles[i][1], mesh.triangles[i][2]);
    ++turned;
  }
  if (2 * turned > part.size()) report.was_inward = true;
  if (turned > 0) {
    report.findings.push_back(turned == part.size()
                                  ? "All normals pointed into the lumen: flipped outward."
                                  : Count(turned, "triangle", "triangles") +
                                        " had inward normals: flipped outward.");
  }
  DropUnusedVertices(mesh);
}

void CountCrossedEdges(const TriangleMesh& mesh, MeshReport& report) {
  size_t crossed = 0;
  for (const auto& [edge, uses] : EdgeTable(mesh)) {
    crossed += uses.size() > 2 && Balance(uses) == 0 ? 1 : 0;
  }
  report.crossed_edges += crossed;
  if (crossed > 0) {
    report.findings.push_back(Count(crossed, "edge", "edges") +
                              " shared by four or more faces: kept; the winding number "
                              "distinguishes inside from outside.");
  }
}

std::vector<int32_t> FacesAtUnbalancedEdges(const TriangleMesh& mesh) {
  std::vector<int32_t> faces;
  for (const auto& [edge, uses] : EdgeTable(mesh)) {
    if (Balance(uses) == 0) continue;
    for (const EdgeUse& use : uses) faces.push_back(use.triangle);
  }
  return faces;
}

TriangleMesh ConesOverBorder(const TriangleMesh& mesh) {
  std::vector<int32_t> parent(mesh.vertices_mm.size());
  std::iota(parent.begin(), parent.end(), 0);
  const auto root = [&](int32_t i) {
    while (parent[i] != i) i = parent[i] = parent[parent[i]];
    return i;
  };
  const EdgeTable edges(mesh);
  for (const auto& [edge, uses] : edges) {
    if (Balance(uses) != 0) parent[root(edge.first)] = root(edge.second);
  }
  TriangleMesh cones;
  for (const auto& [edge, uses] : edges) {
    const int balance = Balance(uses);
    if (balance == 0) continue;
    if (cones.vertices_mm.empty()) cones.vertices_mm = mesh.vertices_mm;
    const int32_t apex = root(edge.first);
    if (edge.first == apex || edge.second == apex) continue;
    const auto [from, to] = balance > 0 ? std::pair(edge.second, edge.first) : edge;
    for (int k = 0; k < std::abs(balance); ++k) cones.triangles.push_back({from, to, apex});
  }
  DropUnusedVertices(cones);
  return cones;
}

std::vector<std::array<int32_t, 2>> Neighbors(const TriangleMesh& mesh) {
  std::vector<std::array<int32_t, 2>> pairs;
  for (const auto& [edge, uses] : EdgeTable(mesh)) {
    for (size_t i = 0; i < uses.size(); ++i) {
      for (size_t k = i + 1; k < uses.size(); ++k) {
        pairs.push_back({uses[i].triangle, uses[k].triangle});
      }
    }
  }
  return pairs;
}

}  // namespace torquer::vessel::repair
