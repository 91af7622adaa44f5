// Keys of an entry in a scene file: [entry], and [instrument.entry].
#pragma once

#include <Eigen/Core>
#include <optional>
#include <string>
#include <vector>

#include "host/support/key_table.h"

namespace torquer::scene {

/// Entry of instruments, at a point or at a place on a centerline.
struct EntrySpec : TableSpec {
  std::optional<Eigen::Vector3d> point_mm;
  std::optional<Eigen::Vector3d> direction;
  std::vector<Eigen::Vector3d> path_mm;  ///< from point_mm on, at the start
  std::optional<std::string> centerline;
  double at_mm = 0;
  std::optional<std::string> towards;
  double towards_at_mm = 0;
  Eigen::Vector2d offset_mm = Eigen::Vector2d::Zero();  ///< along the first and second normal
};

const Keys<EntrySpec>& EntryKeys();

}  // namespace torquer::scene
