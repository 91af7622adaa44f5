// C-arm geometry: the position of the C-arm, and the projection of a point onto its detector.
//
//   source o--------- SOD --------+ isocenter ------+ detector, SID from the source
//          (below the table)                        up of the picture: cranial
//                                                   right of the picture: the patient's left
#pragma once

#include <Eigen/Core>

#include "host/simulator/vessel/patient_axes.h"

namespace torquer::effects {

/// Constants of a C-arm while it moves.
struct CArm {
  Eigen::Vector3d isocenter_mm = Eigen::Vector3d::Zero();
  vessel::PatientAxes axes;
  double sid_mm = 1050;      ///< source to detector
  double sod_mm = 750;       ///< source to isocenter, < sid_mm
  double detector_mm = 300;  ///< width of the picture on the detector
  int width = 512;           ///< pixels, square ones
  int height = 512;
  double pixel_mm() const { return detector_mm / width; }
};

/// Point on the detector: pixel (0, 0) is centered at column 0, row 0, top left.
struct ImagePoint {
  double column = 0;
  double row = 0;
  double depth_mm = 0;  ///< from the source along the middle ray
};

/// Projection of the C-arm at two angles.
class Projection {
 public:
  /// lao_rad turns the detector towards the patient's left, cra_rad then towards the head. At 0, 0
  /// the detector is in front of the patient.
  Projection(const CArm& arm, double lao_rad, double cra_rad);

  /// Point in the frame (right, up, from source to detector) with the source as its origin.
  Eigen::Vector3d ToCamera(const Eigen::Vector3d& point_mm) const {
    return camera_ * (point_mm - source_mm_);
  }
  /// Only for points in front of the source (depth > 0).
  ImagePoint FromCamera(const Eigen::Vector3d& camera_mm) const {
    const double scale = pixels_ / camera_mm[2];
    return {middle_column_ + scale * camera_mm[0], middle_row_ - scale * camera_mm[1],
            camera_mm[2]};
  }
  ImagePoint Project(const Eigen::Vector3d& point_mm) const {
    return FromCamera(ToCamera(point_mm));
  }
  /// Slope of a pixel's ray to the right and up, per mm of depth, in the camera's frame.
  double RightOf(double column) const { return (column - middle_column_) / pixels_; }
  double UpOf(double row) const { return (middle_row_ - row) / pixels_; }
  /// Number of pixels of 1 mm across a middle ray at this depth.
  double PixelsPerMm(double depth_mm) const { return pixels_ / depth_mm; }

  const Eigen::Vector3d& source_mm() const { return source_mm_; }
  /// Rows: right, up, direction from source to detector, in the vessel's frame.
  const Eigen::Matrix3d& camera() const { return camera_; }

 private:
  Eigen::Matrix3d camera_;
  Eigen::Vector3d source_mm_;
  double pixels_;  // SID in pixels
  double middle_column_, middle_row_;
};

}  // namespace torquer::effects
