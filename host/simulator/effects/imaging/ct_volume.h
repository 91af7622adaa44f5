// CT volume: a patient's scan in Hounsfield units (HU), read from a MetaImage file.
#pragma once

#include <Eigen/Core>
#include <array>
#include <cstdint>
#include <string>
#include <vector>

#include "host/simulator/vessel/patient_axes.h"

namespace torquer::effects {

/// Voxels in a lattice that may be oblique.
struct CtVolume {
  std::array<int, 3> size{};  ///< numbers of columns, rows and slices, each at least 2
  /// Columns: the steps to the next column, row and slice, mm, in the frame of the vessel.
  Eigen::Matrix3d step_mm = Eigen::Matrix3d::Identity();
  Eigen::Vector3d first_mm = Eigen::Vector3d::Zero();  ///< center of the first voxel
  std::vector<std::int16_t> values;                    ///< HU; columns run fastest, slices slowest
  std::uint64_t file_hash = 0;                         ///< FNV-1a of the file; 0 without a file

  /// Distance between the elements of `values` that belong to neighbors along an axis.
  std::array<std::ptrdiff_t, 3> Strides() const {
    return {1, size[0], static_cast<std::ptrdiff_t>(size[0]) * size[1]};
  }
};

/// Largest number of voxels in a file: 512 MiB.
inline constexpr std::int64_t kMostCtVoxels = std::int64_t{1} << 28;

/// Reads an uncompressed MetaImage (.mha) of 16-bit signed values. MetaImage files are in LPS,
/// which `axes` takes to the frame of the vessel. Throws UserError naming file, field, value and
/// remedy.
CtVolume ReadCtVolume(const std::string& path, const vessel::PatientAxes& axes);

}  // namespace torquer::effects
