// Scans of known contents, in memory and as MetaImage files.
#pragma once

#include <fmt/format.h>

#include <Eigen/Core>
#include <algorithm>
#include <cmath>
#include <cstdint>
#include <fstream>
#include <functional>
#include <string>
#include <string_view>
#include <vector>

#include "host/simulator/effects/imaging/ct_volume.h"

namespace torquer::test {

/// Scan of cubic voxels. `hu` gives the value at a point in mm.
inline effects::CtVolume ScanOf(const std::array<int, 3>& size, double voxel_mm,
                                const Eigen::Vector3d& first_mm,
                                const std::function<double(const Eigen::Vector3d&)>& hu) {
  effects::CtVolume scan;
  scan.size = size;
  scan.step_mm = voxel_mm * Eigen::Matrix3d::Identity();
  scan.first_mm = first_mm;
  for (int k = 0; k < size[2]; ++k) {
    for (int j = 0; j < size[1]; ++j) {
      for (int i = 0; i < size[0]; ++i) {
        const double value = hu(first_mm + voxel_mm * Eigen::Vector3d(i, j, k));
        scan.values.push_back(static_cast<std::int16_t>(std::lround(value)));
      }
    }
  }
  return scan;
}

/// Share of a voxel on the inner side of a wall at this depth.
inline double ShareAt(double depth_mm, double voxel_mm) {
  return std::clamp(0.5 + depth_mm / voxel_mm, 0.0, 1.0);
}

/// Header of a MetaImage with the voxels of a scan along the axes of LPS.
inline std::string MetaHeader(const effects::CtVolume& scan) {
  return fmt::format(
      "ObjectType = Image\nNDims = 3\nBinaryData = True\nBinaryDataByteOrderMSB = False\n"
      "CompressedData = False\nTransformMatrix = 1 0 0 0 1 0 0 0 1\nOffset = {} {} {}\n"
      "ElementSpacing = {} {} {}\nDimSize = {} {} {}\nElementType = MET_SHORT\n"
      "ElementDataFile = LOCAL\n",
      scan.first_mm[0], scan.first_mm[1], scan.first_mm[2], scan.step_mm(0, 0), scan.step_mm(1, 1),
      scan.step_mm(2, 2), scan.size[0], scan.size[1], scan.size[2]);
}

inline std::string BytesOf(const effects::CtVolume& scan) {
  return {reinterpret_cast<const char*>(scan.values.data()), 2 * scan.values.size()};
}

inline void WriteMeta(const std::string& path, const effects::CtVolume& scan) {
  std::ofstream(path, std::ios::binary) << MetaHeader(scan) << BytesOf(scan);
}

}  // namespace torquer::test
