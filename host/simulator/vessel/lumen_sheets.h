// Lumen sheets: what encloses no volume in a surface that is divided where it meets itself.
#pragma once

#include <cstddef>
#include <memory>
#include <string>
#include <vector>

#include "host/simulator/vessel/surface_regions.h"
#include "host/simulator/vessel/triangle_bvh.h"
#include "host/simulator/vessel/triangle_mesh.h"

namespace torquer::vessel {

/// A surface without its sheets.
struct WithoutSheets {
  std::unique_ptr<TriangleBvh> walls;  ///< without signs
  std::vector<SurfaceRegion> regions;  ///< of the walls
  TriangleMesh sheets;
  size_t sheet_count = 0;
};

/// Removes sheets, the clearest first, until every edge balances or no sheet is left. Parts that a
/// sheet separated get one orientation, outward. Other faces keep theirs, so a fold that is inside
/// out stays so.
///
/// mesh: triangles that meet in whole edges. Throws UserError that begins with `name` if the rest
/// has one side only.
WithoutSheets DropSheets(TriangleMesh mesh, const std::string& name);

}  // namespace torquer::vessel
