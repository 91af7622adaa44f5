// A surface that was checked, as a picture.
#pragma once

#include <string>

#include "host/simulator/vessel/mesh_check.h"

namespace torquer::vessel {

/// One <svg> with views along z, y and x: the surface that the simulator would take, or else the
/// file's; open edges of the file in red, edges of more than two triangles in magenta, and the
/// proposed entries as numbered arrows. Holds no text of the file. Empty where the file has no
/// triangles.
std::string DrawCheck(const MeshCheck& check);

}  // namespace torquer::vessel
