#include "host/simulator/vessel/mesh_repair.h"

#include <algorithm>
#include <array>
#include <cassert>
#include <cmath>
#include <cstdio>
#include <map>
#include <numeric>
#include <set>
#include <unordered_map>
#include <utility>

#include "host/support/error.h"

namespace torquer::vessel::repair {

using Eigen::Vector3d;

namespace {

// Loops of a smaller radius are holes, not ends of vessels.
constexpr double kSmallestOpeningMm = 0.4;
// Root mean square distance of an opening's rim from its plane, as a share of its radius.
constexpr double kLeastFlat = 0.25;
// Square of a rim's length over that of a circle of the same area; ends cut 75 degrees off square
// have 1.8, ragged ones up to 2.
constexpr double kLeastRound = 2.2;
constexpr double kNegligibleArea = 1e-3;

using Edge = std::pair<int32_t, int32_t>;  // smaller vertex first

struct Use {
  int32_t triangle;
  int corner;    // the edge runs from this corner to the next
  bool forward;  // from its smaller vertex to its larger
};

std::map<Edge, std::vector<Use>> EdgesOf(const TriangleMesh& mesh) {
  std::map<Edge, std::vector<Use>> edges;
  for (size_t i = 0; i < mesh.triangles.size(); ++i) {
    for (int corner = 0; corner < 3; ++corner) {
      const int32_t a = mesh.triangles[i][corner], b = mesh.triangles[i][(corner + 1) % 3];
      edges[std::minmax(a, b)].push_back({static_cast<int32_t>(i), corner, a < b});
    }
  }
  return edges;
}

void Keep(TriangleMesh& mesh, const std::vector<char>& keep) {
  size_t kept = 0;
  for (size_t i = 0; i < mesh.triangles.size(); ++i) {
    if (keep[i]) mesh.triangles[kept++] = mesh.triangles[i];
  }
  mesh.triangles.resize(kept);
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

std::string Count(size_t count, const std::string& singular, const std::string& plural) {
  return std::to_string(count) + " " + (count == 1 ? singular : plural);
}

}  // namespace

std::string Number(double value) {
  char text[32];
  std::snprintf(text, sizeof text, "%.4g", value);
  return text;
}

std::string Place(const Vector3d& point_mm) {
  char text[96];
  std::snprintf(text, sizeof text, "(%.1f, %.1f, %.1f) mm", point_mm.x(), point_mm.y(),
                point_mm.z());
  return text;
}

void Weld(TriangleMesh& mesh, double tolerance_mm, MeshReport& report) {
  struct Hash {
    size_t operator()(const std::array<int64_t, 3>& cell) const {
      uint64_t hash = 0;
      for (const int64_t c : cell) hash = (hash ^ static_cast<uint64_t>(c)) * 0x9e3779b97f4a7c15;
      return hash ^ (hash >> 32);
    }
  };
  std::unordered_map<std::array<int64_t, 3>, std::vector<int32_t>, Hash> cells;
  std::vector<Vector3d> kept;
  std::vector<int32_t> moved(mesh.vertices_mm.size());
  for (size_t i = 0; i < mesh.vertices_mm.size(); ++i) {
    const Vector3d& p = mesh.vertices_mm[i];
    std::array<int64_t, 3> cell;
    for (int a = 0; a < 3; ++a) cell[a] = static_cast<int64_t>(std::floor(p[a] / tolerance_mm));
    int32_t same = -1;
    for (int n = 0; n < 27 && same < 0; ++n) {
      const auto near =
          cells.find({cell[0] + n % 3 - 1, cell[1] + n / 3 % 3 - 1, cell[2] + n / 9 - 1});
      if (near == cells.end()) continue;
      for (const int32_t other : near->second) {
        if ((kept[other] - p).norm() <= tolerance_mm) {
          same = other;
          break;
        }
      }
    }
    if (same < 0) {
      same = static_cast<int32_t>(kept.size());
      kept.push_back(p);
      cells[cell].push_back(same);
    }
    moved[i] = same;
  }
  report.vertices_welded += mesh.vertices_mm.size() - kept.size();
  mesh.vertices_mm = std::move(kept);
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
                              " on top of another, left out.");
  }
}

std::vector<int> Parts(const TriangleMesh& mesh, int* count) {
  std::vector<int32_t> parent(mesh.triangles.size());
  std::iota(parent.begin(), parent.end(), 0);
  const auto root = [&](int32_t i) {
    while (parent[i] != i) i = parent[i] = parent[parent[i]];
    return i;
  };
  for (const auto& [edge, uses] : EdgesOf(mesh)) {
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
  for (const auto& [edge, uses] : EdgesOf(mesh)) {
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
  const auto edges = EdgesOf(mesh);
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
                              " oriented against the neighbors, turned.");
  }
}

namespace {

// Boundary loops as vertices, each against the direction of its triangles: the way a cap runs.
std::vector<std::vector<int32_t>> BoundaryLoops(const TriangleMesh& mesh, const std::string& name) {
  std::multimap<int32_t, int32_t> onward;
  for (const auto& [edge, uses] : EdgesOf(mesh)) {
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
    if (step == onward.end()) {
      if (way.size() > 1) {
        throw UserError(name + ": the surface's border runs into an edge of several faces at " +
                        Place(mesh.vertices_mm[way.back()]) + "; repair the surface there");
      }
      way.clear();
      continue;
    }
    const int32_t to = step->second;
    onward.erase(step);
    const auto before = std::find(way.begin(), way.end(), to);
    if (before == way.end()) {
      way.push_back(to);
      continue;
    }
    // A way that meets itself closes a loop and goes on from there.
    loops.emplace_back(before, way.end());
    way.erase(before + 1, way.end());
  }
  return loops;
}

}  // namespace

void CapLoops(TriangleMesh& mesh, const std::string& name, MeshReport& report) {
  struct Hole {
    double radius_mm;
    Vector3d center_mm;
  };
  std::vector<Hole> holes;
  for (const auto& loop : BoundaryLoops(mesh, name)) {
    const size_t count = loop.size();
    Vector3d center = Vector3d::Zero(), area = Vector3d::Zero();
    double length = 0;
    for (size_t i = 0; i < count; ++i) {
      const Vector3d &a = mesh.vertices_mm[loop[i]], &b = mesh.vertices_mm[loop[(i + 1) % count]];
      center += (a + b) / 2 * (b - a).norm();
      length += (b - a).norm();
    }
    center /= length;
    double largest_distance = 0;
    for (size_t i = 0; i < count; ++i) {
      const Vector3d a = mesh.vertices_mm[loop[i]] - center;
      area += a.cross(mesh.vertices_mm[loop[(i + 1) % count]] - center) / 2;
      largest_distance = std::max(largest_distance, a.norm());
    }
    const double radius = std::sqrt(area.norm() / M_PI);
    const Vector3d outward = area.normalized();
    double off_plane = 0;
    for (const int32_t vertex : loop) {
      off_plane += std::pow(outward.dot(mesh.vertices_mm[vertex] - center), 2);
    }
    off_plane = std::sqrt(off_plane / static_cast<double>(count));
    const bool is_opening = radius >= kSmallestOpeningMm;
    // A slit between two rims has no area to speak of, but is as wrong as a hole of its length.
    const double size = std::max(radius, largest_distance / 4);
    const double round = length * length / (4 * M_PI * area.norm());
    if (size >= kSmallestOpeningMm && !(off_plane <= kLeastFlat * radius && round <= kLeastRound)) {
      throw UserError(name + ": a hole with a rim of " + std::to_string(count) + " edges, " +
                      Number(length) + " mm long, at " + Place(center) +
                      " is no end of a vessel (neither flat nor round: " + Number(off_plane) +
                      " mm off a plane, " + Number(round) +
                      " times a circle's rim squared); part of the surface is missing: fill the "
                      "hole or cut the vessel off square");
    }
    if (count == 3) {
      mesh.triangles.push_back({loop[0], loop[1], loop[2]});
    } else {
      const auto middle = static_cast<int32_t>(mesh.vertices_mm.size());
      mesh.vertices_mm.push_back(center);
      for (size_t i = 0; i < count; ++i) {
        mesh.triangles.push_back({loop[i], loop[(i + 1) % count], middle});
      }
    }
    if (is_opening) {
      report.openings.push_back({center, outward, radius, -outward});
    } else {
      holes.push_back({radius, center});
    }
  }
  report.holes_closed += holes.size();
  if (!holes.empty()) {
    report.findings.push_back(Count(holes.size(), "small hole", "small holes") +
                              " closed, the first at " + Place(holes.front().center_mm) + ".");
  }
}

void MendSlivers(TriangleMesh& mesh, double tolerance_mm, MeshReport& report) {
  constexpr int kPasses = 5;
  size_t repaired = 0;
  for (int pass = 0; pass < kPasses; ++pass) {
    const auto edges = EdgesOf(mesh);
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
      const auto& uses = edges.at(std::minmax(a, b));
      if (uses.size() != 2) continue;
      const Use& other = uses[0].triangle == static_cast<int32_t>(i) ? uses[1] : uses[0];
      if (touched[other.triangle]) continue;
      const int32_t d = mesh.triangles[other.triangle][(other.corner + 2) % 3];
      // The new edge must not be one that exists already.
      if (d == c || edges.count(std::minmax(c, d)) > 0) continue;
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
                              " repaired by turning an edge.");
  }
}

void PointOutward(TriangleMesh& mesh, const std::string& name, MeshReport& report) {
  int count = 0;
  const std::vector<int> part = Parts(mesh, &count);
  std::vector<double> volume(count, 0);
  const Vector3d about = mesh.Corner(0, 0);
  for (size_t i = 0; i < part.size(); ++i) {
    volume[part[i]] += (mesh.Corner(i, 0) - about)
                           .dot((mesh.Corner(i, 1) - about).cross(mesh.Corner(i, 2) - about)) /
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
                                  ? "All normals pointed into the lumen: turned outward."
                                  : Count(turned, "triangle", "triangles") +
                                        " had inward normals: turned outward.");
  }
  size_t crossed = 0;
  for (const auto& [edge, uses] : EdgesOf(mesh)) {
    if (uses.size() == 2) continue;
    int balance = 0;
    for (const Use& use : uses) balance += use.forward ? 1 : -1;
    if (balance != 0) {
      throw UserError(name + ": " + std::to_string(uses.size()) + " faces meet in one edge at " +
                      Place(mesh.vertices_mm[edge.first]) +
                      " and do not separate inside from outside there (a wall within the lumen?); "
                      "remove the extra faces");
    }
    ++crossed;
  }
  report.crossed_edges += crossed;
  if (crossed > 0) {
    report.findings.push_back(
        Count(crossed, "edge", "edges") +
        " shared by four or more faces: kept, inside and outside decided by the winding number.");
  }
  DropUnusedVertices(mesh);
}

}  // namespace torquer::vessel::repair
