// Mesh picture: a checked surface as SVG.
#pragma once

#include <string>

#include "host/simulator/vessel/mesh_check.h"

namespace torquer::vessel {

/// One <svg> with views along z, y and x: the surface that the simulator would take, or else the
/// file's. Open edges of the file are red, edges of more than two triangles magenta, walls left out
/// orange. The proposed entries are numbered arrows. Contains no text of the file. Empty if the
/// file has no triangles.
std::string DrawCheck(const MeshCheck& check);

}  // namespace torquer::vessel
