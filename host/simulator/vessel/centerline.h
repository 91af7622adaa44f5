// Vessel centerlines with radii, and the network that they form.
#pragma once

#include <Eigen/Core>
#include <string>
#include <utility>
#include <vector>

#include "host/simulator/core/clearance_field.h"

namespace torquer::vessel {

/// What a centerline says at one arc length.
struct CenterlineSample {
  Eigen::Vector3d position_mm;
  Eigen::Vector3d tangent;  ///< unit, toward larger arc length
  double radius_mm = 0;     ///< of the vessel there; 0 where the file gives none
};

/// One curve through points, with a continuous tangent (cubic Hermite between the points) and a
/// radius that is linear between them, by arc length.
class Centerline {
 public:
  /// points_mm: at least two distinct ones, finite; a point within 1e-6 mm of the one before it is
  /// dropped. radii_mm: one a point, >= 0. Throws UserError that begins with the name.
  Centerline(std::string name, const std::vector<Eigen::Vector3d>& points_mm,
             const std::vector<double>& radii_mm);
  /// The same with the unit tangents known.
  Centerline(std::string name, const std::vector<Eigen::Vector3d>& points_mm,
             const std::vector<Eigen::Vector3d>& tangents, const std::vector<double>& radii_mm);

  const std::string& name() const { return name_; }
  double length_mm() const { return arc_mm_.back(); }
  const std::vector<Eigen::Vector3d>& points_mm() const { return points_mm_; }
  const std::vector<double>& radii_mm() const { return radii_mm_; }
  /// Arc length of each point, mm, from 0.
  const std::vector<double>& arc_lengths_mm() const { return arc_mm_; }

  /// The curve at an arc length, which is clamped to [0, length_mm()].
  CenterlineSample At(double s_mm) const;

  /// Arc length of the curve's nearest point (of its chords, within a chord's sagitta), and the
  /// distance to it.
  struct Nearest {
    double s_mm = 0;
    double distance_mm = 0;
  };
  Nearest NearestTo(const Eigen::Vector3d& point_mm) const;

  /// The part from one arc length to another, which may be the smaller: then it runs backward.
  Centerline Part(double from_mm, double to_mm, std::string name) const;

 private:
  void Measure();

  std::string name_;
  std::vector<Eigen::Vector3d> points_mm_;
  std::vector<Eigen::Vector3d> tangents_;
  std::vector<double> radii_mm_;
  std::vector<double> arc_mm_;
};

/// A place on a network: a curve and an arc length on it.
struct CenterlinePlace {
  size_t curve = 0;
  double s_mm = 0;
};

/// Curves joined where an end of one lies on another.
class CenterlineNetwork {
 public:
  CenterlineNetwork() = default;
  /// An end within join_tolerance_mm of another curve (at any arc length) joins it there. Throws
  /// UserError where there are more curves, or longer ones, than a vessel may have.
  explicit CenterlineNetwork(std::vector<Centerline> curves, double join_tolerance_mm = 0.5);

  const std::vector<Centerline>& curves() const { return curves_; }
  bool empty() const { return curves_.empty(); }

  /// A place where curves meet: two or more (curve, arc length).
  struct Joint {
    Eigen::Vector3d position_mm;
    std::vector<CenterlinePlace> places;
  };
  const std::vector<Joint>& joints() const { return joints_; }

  /// Index of the curve with a name. Where none has it, the one curve whose name ends in it or
  /// holds it in parentheses ("LCCA", "2") will do. Throws UserError naming the nearest ones.
  size_t Find(const std::string& name) const;
  /// A place by name: end is "start" or "end". Throws UserError.
  CenterlinePlace Place(const std::string& curve, const std::string& end) const;
  /// A place by arc length, mm, within [0, length]. Throws UserError.
  CenterlinePlace Place(const std::string& curve, double s_mm) const;
  /// The place nearest to a point, over all curves; distance_mm, if given, gets the distance.
  CenterlinePlace NearestTo(const Eigen::Vector3d& point_mm, double* distance_mm = nullptr) const;
  CenterlineSample At(const CenterlinePlace& place) const;

  /// The shortest way along the curves, as one curve that begins at `from` and ends at `to`.
  /// Corners at joints are kept as the file has them, with the tangent averaged. Throws UserError
  /// where the two places are not connected.
  Centerline Path(const CenterlinePlace& from, const CenterlinePlace& to) const;

 private:
  std::vector<Centerline> curves_;
  std::vector<Joint> joints_;
};

/// A file with a curve, as it was when it was read.
struct CurveFile {
  std::string path;
  std::string contents;
};

/// Reads every .mrk.json of a folder, in the order of their names. Throws UserError naming the
/// folder or the file where there is none, or one that cannot be read.
std::vector<CurveFile> ReadCurveFiles(const std::string& folder);

/// The curve of a 3D Slicer Markups file (.mrk.json) with its "Radius" measurement.
///
/// Coordinates are taken as they stand, times mm_per_unit (the file's frame is that of the surface
/// beside it). Throws UserError naming the file, the field, the value and the remedy.
Centerline ParseSlicerCurve(const CurveFile& file, double mm_per_unit = 1);

/// The curves of several such files, joined.
CenterlineNetwork ParseSlicerCurves(const std::vector<CurveFile>& files, double mm_per_unit = 1);

/// A curve moved into the middle of the lumen.
struct CenteredCurve {
  Centerline curve;
  double largest_shift_mm = 0;
  double cut_at_start_mm = 0, cut_at_end_mm = 0;  ///< of the curve's own ends, outside the lumen
};

/// Moves a curve's points sideways up the clearance, by at most reach_mm, smooths them, cuts off
/// ends where the lumen does not go, and takes the clearance as radius. Throws UserError where the
/// curve leaves the lumen in between.
CenteredCurve CenteredInLumen(const Centerline& curve, const ClearanceField& field,
                              double reach_mm = 6);

/// A stretch of a curve that does not run in the lumen.
struct OutsideStretch {
  std::string curve;
  double from_mm = 0;
  double to_mm = 0;
  double worst_clearance_mm = 0;  ///< the smallest clearance on it
};

/// Where the curves of a network leave the lumen (clearance <= 0), looked at every step_mm.
std::vector<OutsideStretch> FindStretchesOutside(const CenterlineNetwork& network,
                                                 const ClearanceField& field, double step_mm = 1);

}  // namespace torquer::vessel
