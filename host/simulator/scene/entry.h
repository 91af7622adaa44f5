// Entry of instruments: the end of their sheath, and the path along which they lie at the start.
#pragma once

#include <Eigen/Core>
#include <vector>

#include "host/simulator/core/wire_model.h"
#include "host/simulator/scene/entry_spec.h"
#include "host/simulator/vessel/centerline.h"

namespace torquer::scene {

struct Entry {
  Sheath sheath;
  std::vector<Eigen::Vector3d> start_path_mm;  ///< empty for an entry at a point without a path
};

/// Throws UserError naming file, line, key, value and remedy.
Entry FindEntry(const EntrySpec& spec, const vessel::CenterlineNetwork& network);

}  // namespace torquer::scene
