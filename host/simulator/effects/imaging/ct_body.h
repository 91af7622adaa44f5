// CT body: the patient's scan as the body in the picture.
//
//   CtVolume, carved --CtAttenuation--> 1/mm in each voxel --rays--> Plane
//
// The rays are integrated slice by slice, bilinear in each slice (Joseph, IEEE Trans Med Imaging
// 1982;1:192). All pixels take 1 to 1.5 s. So a picture from a new place of the C-arm has few rays
// in the scan of half the resolution. Each further picture from there replaces some rows, from the
// middle outwards.
#pragma once

#include <Eigen/Core>
#include <array>
#include <cstdint>
#include <vector>

#include "host/simulator/effects/imaging/ct_attenuation.h"
#include "host/simulator/effects/imaging/ct_volume.h"
#include "host/simulator/effects/imaging/fluoroscopy_attenuation.h"
#include "host/simulator/effects/imaging/fluoroscopy_projection.h"

namespace torquer::effects {

/// Constant, so several threads may use it.
class CtBody {
 public:
  CtBody(const CtBody&) = delete;
  CtBody& operator=(const CtBody&) = delete;
  /// `superior`: the patient's direction in the frame of the volume. Beyond its first and last
  /// slice along that axis, the body continues unchanged for 200 mm. Beyond the other sides is air.
  CtBody(CtVolume volume, const CtAttenuation& attenuation, const Eigen::Vector3d& superior);

  /// Line integral along the middle ray.
  double MiddleIntegral(const Projection& projection) const;
  /// Attenuation of soft tissue, 1/mm.
  double tissue_1_mm() const { return tissue_1_mm_; }
  std::uint64_t file_hash() const { return file_hash_; }

  /// Sets all pixels from few rays. Returns the mean in the field's middle, which sets the
  /// exposure.
  float FillCoarsely(const Projection& projection, Plane& plane) const;
  /// Number of parts of a plane that are fine in a picture after `still` others from the same
  /// place.
  static int FineParts(std::int64_t still, const Plane& plane);
  /// Sets the pixels of the parts [from, to), one ray for each.
  void Refine(const Projection& projection, int from, int to, Plane& plane) const;

 private:
  // The scan at one resolution.
  struct Level {
    std::array<int, 3> size{};
    std::array<std::ptrdiff_t, 3> strides{};
    Eigen::Matrix3d to_index;              // from mm
    Eigen::Vector3d first_mm;              // center of the first voxel
    std::array<int, 3> beyond{};           // voxels by which an axis continues
    const std::int16_t* values = nullptr;  // in units of unit_1_mm_
  };
  // Pixels at equal steps.
  struct Pixels {
    double first_column = 0, first_row = 0;
    int columns = 1, rows = 1, step = 1;
  };
  struct Rays;

  static CtVolume Halved(const CtVolume& volume);
  Level LevelOf(const CtVolume& volume, int long_axis) const;
  static int MainAxis(const Level& level, const Projection& projection);
  void Integrate(const Level& level, const Projection& projection, const Pixels& pixels,
                 float* integrals) const;
  static void Aim(const Level& level, int axis, const Projection& projection, const Pixels& pixels,
                  Rays& rays);

  double unit_1_mm_ = 0;  // of the values of the levels
  double tissue_1_mm_ = 0;
  std::uint64_t file_hash_ = 0;
  CtVolume fine_volume_, half_volume_;
  Level fine_, half_;
};

}  // namespace torquer::effects
