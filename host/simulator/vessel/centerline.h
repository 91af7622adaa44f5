// Vessel centerlines with radii, and the network that they form.
#pragma once

#include <Eigen/Core>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "host/simulator/core/clearance_field.h"
#include "host/simulator/vessel/distance_source.h"
#include "host/simulator/vessel/patient_space.h"

namespace torquer::vessel {

/// Centerline at one arc length.
struct CenterlineSample {
  Eigen::Vector3d position_mm;
  Eigen::Vector3d tangent;  ///< unit, toward larger arc length
  double radius_mm = 0;     ///< of the vessel, >= 0
};

/// Curve through points with a continuous tangent: cubic Hermite between the points. The radius is
/// linear between them, by arc length.
class Centerline {
 public:
  /// `points_mm`: at least two distinct ones, finite; a point within 1e-6 mm of the one before it
  /// is dropped. `radii_mm`: one per point, >= 0. Throws UserError naming the curve.
  Centerline(std::string name, const std::vector<Eigen::Vector3d>& points_mm,
             const std::vector<double>& radii_mm);
  /// As above, with given unit tangents, one per point.
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

  /// Nearest point of the curve: its arc length and distance. It is found on the chords, so its
  /// error is at most a chord's sagitta.
  struct Nearest {
    double s_mm = 0;
    double distance_mm = 0;
  };
  Nearest NearestTo(const Eigen::Vector3d& point_mm) const;

  /// Part of the curve between two arc lengths, mm. It runs backward if to_mm < from_mm.
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

/// Network of curves, joined at each end that lies on another curve.
class CenterlineNetwork {
 public:
  CenterlineNetwork() = default;
  /// An end within join_tolerance_mm of another curve (at any arc length) joins it there. Throws
  /// UserError if the number or the total length of the curves exceeds the limits in
  /// curve_limits.h.
  explicit CenterlineNetwork(std::vector<Centerline> curves, double join_tolerance_mm = 0.5);

  const std::vector<Centerline>& curves() const { return curves_; }
  bool empty() const { return curves_.empty(); }

  /// Joint of curves: two or more places (curve, arc length).
  struct Joint {
    Eigen::Vector3d position_mm;
    std::vector<CenterlinePlace> places;
  };
  const std::vector<Joint>& joints() const { return joints_; }

  /// Index of the curve with a name. Otherwise, index of the only curve with the name as its last
  /// word or in parentheses ("LCCA", "2"). Throws UserError naming the nearest names.
  size_t Find(const std::string& name) const;
  /// Place of an end by name: `end` is "start" or "end". Throws UserError on unknown names.
  CenterlinePlace Place(const std::string& curve, const std::string& end) const;
  /// Place by arc length, mm, within [0, length]. Throws UserError outside of it or on an unknown
  /// curve.
  CenterlinePlace Place(const std::string& curve, double s_mm) const;
  /// Place nearest to a point, over all curves. distance_mm receives the distance unless it is
  /// null.
  CenterlinePlace NearestTo(const Eigen::Vector3d& point_mm, double* distance_mm = nullptr) const;
  CenterlineSample At(const CenterlinePlace& place) const;

  /// Shortest way along the curves, as one curve from `from` to `to`. Corners at joints are kept,
  /// with the tangent averaged. Throws UserError if the places are not connected or less than 1e-3
  /// mm apart.
  Centerline Path(const CenterlinePlace& from, const CenterlinePlace& to) const;

 private:
  std::vector<Centerline> curves_;
  std::vector<Joint> joints_;
};

/// Path of a curve's file, and the contents when it was read.
struct CurveFile {
  std::string path;
  std::string contents;
};

/// Reads every .mrk.json of a folder, in the order of their names. Throws UserError naming the
/// folder or the file: no such file, too many (curve_limits.h), or one that cannot be read.
std::vector<CurveFile> ReadCurveFiles(const std::string& folder);

/// Curve of a 3D Slicer Markups file (.mrk.json) with its "Radius" measurement.
///
/// Coordinates are in the file's coordinateUnits, radii in their units, and otherwise in mm. They
/// are brought into the space of the surface if both the file and `surface` name one. Throws
/// UserError naming the file, the field, the value and the remedy.
Centerline ParseSlicerCurve(const CurveFile& file, std::optional<PatientSpace> surface = {});

/// Network of the curves of several such files; `findings` gets a sentence for each that was
/// brought into another space. Throws UserError if the files name different spaces and `surface` is
/// none.
CenterlineNetwork ParseSlicerCurves(const std::vector<CurveFile>& files,
                                    std::optional<PatientSpace> surface = {},
                                    std::vector<std::string>* findings = nullptr);

/// A curve moved into the middle of the lumen.
struct CenteredCurve {
  Centerline curve;
  double largest_shift_mm = 0;
  double cut_at_start_mm = 0, cut_at_end_mm = 0;  ///< lengths cut off its ends, outside the lumen
};

/// Moves a curve's points sideways up the clearance by at most reach_mm and smooths them. Cuts off
/// ends outside the lumen and takes the clearance as radius. Throws UserError if the curve leaves
/// the lumen between its ends or does not run in it.
CenteredCurve CenteredInLumen(const Centerline& curve, const ClearanceField& field,
                              double reach_mm = 6);

/// Stretch of a curve outside the lumen.
struct OutsideStretch {
  std::string curve;
  double from_mm = 0;
  double to_mm = 0;
  double worst_clearance_mm = 0;  ///< the smallest clearance on it
};

/// Stretches of a network's curves outside the lumen (distance <= 0), sampled every step_mm. Their
/// ends are exact within 0.01 mm. It asks the surface itself, because a field of bricks would build
/// them along every curve.
std::vector<OutsideStretch> FindStretchesOutside(const CenterlineNetwork& network,
                                                 const DistanceSource& surface, double step_mm = 1);

}  // namespace torquer::vessel
