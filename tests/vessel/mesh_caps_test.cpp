// Test of the measures that distinguish an end of a vessel from a hole.
#include <cmath>
#include <string>

#include "catch2/catch.hpp"
#include "host/simulator/vessel/surface_mesh.h"
#include "host/support/error.h"
#include "tests/support/made_meshes.h"

namespace torquer::vessel {
namespace {

using Catch::Contains;
using Eigen::Vector3d;

TEST_CASE("a hole is refused with the measure by which it is no end of a vessel") {
  const auto refusal = [](const TriangleMesh& mesh) {
    try {
      RepairSurface(mesh, "x");
    } catch (const UserError& error) {
      return std::string(error.what());
    }
    return std::string();
  };
  // Flat and round, but narrow: the unit may be another one.
  const std::string narrow = refusal(MakeTubeMesh(5, 0.35));
  CHECK_THAT(narrow, Contains("(its radius is 0.34") && Contains("of an end at least 0.4 mm)") &&
                         Contains("declare another mesh_unit"));
  CHECK_THAT(narrow, !Contains("flat") && !Contains("round:"));
  // A rim that goes up and down by 3 mm, and a flat one six times as wide as high.
  TriangleMesh waved = MakeTubeMesh(), oval = MakeTubeMesh();
  for (Vector3d& v : waved.vertices_mm) {
    if (v.x() < 0.1) v.x() = -3 * std::cos(2 * std::atan2(v.y(), v.z()));
  }
  for (Vector3d& v : oval.vertices_mm) v = v.cwiseProduct(Vector3d(1, 3, 0.5));
  CHECK_THAT(refusal(waved), Contains("(not flat: ") && Contains("perpendicular to its axis"));
  CHECK_THAT(refusal(oval), Contains("(not round: ") && Contains("perpendicular to its axis"));
}

}  // namespace
}  // namespace torquer::vessel
