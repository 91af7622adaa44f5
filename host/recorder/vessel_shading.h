// A vessel's surface as shaded polygons, ready to be painted far to near.
#pragma once

#include <Eigen/Core>
#include <Eigen/Geometry>
#include <array>
#include <cstddef>
#include <vector>

namespace torquer {

/// A vessel's surface for pictures; may have holes, and either winding.
struct PictureVessel {
  std::vector<std::array<Eigen::Vector3d, 3>> triangles_mm;
};

/// The patient's directions in the vessel's frame; unit length, orthogonal.
struct PatientAxes {
  Eigen::Vector3d left;
  Eigen::Vector3d posterior;
  Eigen::Vector3d superior;
};

/// Takes a point of the vessel's frame to (x to the viewer's right, y up, z away from the viewer),
/// mm, of one who looks at the patient from the front: the patient's left is on the right.
Eigen::Vector3d SeenFromTheFront(const PatientAxes& axes, const Eigen::Vector3d& point_mm);

/// One polygon as the viewer sees it.
struct ShadedTriangle {
  std::array<Eigen::Vector2d, 3> corners_mm;  ///< x right, y up
  double light = 0;                           ///< 0 dark .. 1 bright
};

/// The two layers between which an instrument is drawn, each in painting order, far to near.
struct ShadedVessel {
  std::vector<ShadedTriangle> far_wall;   ///< its inner side
  std::vector<ShadedTriangle> near_wall;  ///< its outer side, to be painted translucent
};

/// How finely to shade. Triangles whose longest side as seen is above the limit are divided.
struct ShadingDetail {
  double side_mm = 0;                  ///< limit in general, > 0
  double fine_side_mm = 0;             ///< limit in the fine region, > 0
  Eigen::AlignedBox2d fine_region_mm;  ///< as seen
  std::size_t most_triangles = 0;      ///< both limits grow where they would make more
};

/// Shades `vessel` smoothly: as if its surface were curved between the corners.
ShadedVessel ShadeVessel(const PictureVessel& vessel, const PatientAxes& axes,
                         const ShadingDetail& detail);

}  // namespace torquer
