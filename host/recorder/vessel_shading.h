// Vessel shading: a vessel's surface as shaded polygons, in painting order from far to near.
#pragma once

#include <Eigen/Core>
#include <Eigen/Geometry>
#include <array>
#include <cstddef>
#include <vector>

namespace torquer {

/// Surface of a vessel for pictures; may have holes, and either winding.
struct PictureVessel {
  std::vector<std::array<Eigen::Vector3d, 3>> triangles_mm;
};

/// Directions of the patient in the vessel's frame; unit length, orthogonal.
struct PatientAxes {
  Eigen::Vector3d left;
  Eigen::Vector3d posterior;
  Eigen::Vector3d superior;
};

/// Maps a point of the vessel's frame to the viewer's frame, mm. The viewer looks at the patient
/// from the front: x to the right, y up, z away from the viewer. The patient's left is on the
/// right.
Eigen::Vector3d SeenFromTheFront(const PatientAxes& axes, const Eigen::Vector3d& point_mm);

/// Projected triangle as the viewer sees it.
struct ShadedTriangle {
  std::array<Eigen::Vector2d, 3> corners_mm;  ///< x right, y up
  double light = 0;                           ///< 0 dark .. 1 bright
};

/// Two wall layers with the instrument drawn between them, each in painting order from far to near.
struct ShadedVessel {
  std::vector<ShadedTriangle> far_wall;   ///< its inner side
  std::vector<ShadedTriangle> near_wall;  ///< its outer side, to be painted translucent
};

/// Level of detail. Triangles with a projected side above the limit are divided.
struct ShadingDetail {
  double side_mm = 0;                  ///< limit in general, > 0
  double fine_side_mm = 0;             ///< limit in the fine region, > 0
  Eigen::AlignedBox2d fine_region_mm;  ///< as seen
  std::size_t most_triangles = 0;  ///< both limits are enlarged if they would give more triangles
};

/// Shades `vessel` smoothly, with normals interpolated between the corners.
ShadedVessel ShadeVessel(const PictureVessel& vessel, const PatientAxes& axes,
                         const ShadingDetail& detail);

}  // namespace torquer
