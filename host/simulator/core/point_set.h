// Point set: the points of a curve at which the wall and effects act.
#pragma once

#include <Eigen/Core>
#include <algorithm>
#include <array>
#include <cstdint>
#include <vector>

#include "host/simulator/core/clearance_field.h"
#include "host/simulator/core/frames.h"
#include "host/simulator/core/instrument_pose.h"

namespace torquer {

/// Place at which a curve lies beside the lumen wall of a curve around it (README, section 18). Or
/// it lies beside another curve; the lumen is then the surface of that curve. All fields are
/// functions of the state; friction in the lumen depends on their changes. The first normal of a
/// surface is fixed to the material of an instrument that twists. Otherwise it is fixed to the
/// segment.
struct LumenContact {
  int inner = 0;           ///< instrument whose surface faces the lumen's wall
  int outer = 0;           ///< instrument whose lumen it is
  int pair = 0;            ///< number of the pair of curves
  int inner_from_tip = 0;  ///< piece of the inner curve, counted from its tip
  int outer_from_tip = 0;  ///< segment of the outer curve at the foot, counted from its tip
  double lever_mm = 0;     ///< radius of the inner one; minus that radius beside the outer one
  double lumen_mm = 0;     ///< radius of the lumen
  double force_N = 0;      ///< contact force between the curves; 0 without contact
  /// Position of the inner instrument's material along that of the outer one, up to a constant.
  double ahead_mm = 0;
  /// Offset of the inner curve from the outer one, across it, in the first and second normal of the
  /// lumen.
  Eigen::Vector2d offset_mm = Eigen::Vector2d::Zero();
  double turn_rad = 0;  ///< from the first normal of the lumen to that of the inner surface
  /// Only beside another curve: arc length of the place, less that of the inner instrument's tip.
  double inner_mm = 0;
  /// Only beside another curve: tangent, first and second normal of the inner surface, in those of
  /// the outer one.
  Eigen::Matrix3d inner_axes = Eigen::Matrix3d::Identity();
};

/// Points of a curve at which wall and effects act: K per segment, at fractions 1/K .. 1 of it.
/// Point q belongs to segment q / K. All arrays have one entry per point. Without room in a lumen,
/// all instruments are on curve 0.
struct PointSet {
  int per_segment = 1;                    ///< K
  std::vector<Eigen::Vector3d> position;  ///< mm
  /// Length of wire that the point stands for: half of the pieces before and after it. So the last
  /// point has half a piece, and the sheath has the first half piece.
  std::vector<double> weight_mm;
  std::vector<double> radius_mm;           ///< of the wire there; see Parted
  std::vector<std::uint8_t> touches;       ///< 1 where the wire's surface is beyond the wall
  std::vector<int> near;                   ///< the points that touch or nearly do, ascending
  std::vector<ClearanceSample> clearance;  ///< valid only at `near` points
  std::vector<double> stiffness_N_mm2;     ///< of the wall, see Parted; valid only at `near` points
  Eigen::Vector3d start = Eigen::Vector3d::Zero();  ///< mm; start of the piece of point 0
  double spacing_mm = 1;                            ///< distance between points, lambda / K
  double first_spacing_mm = 1;  ///< distance between points of the first segment

  /// Point whose length contains the tip of an instrument. Its parts have different surfaces. Its
  /// radius is the mean radius of the parts that touch. Its stiffness is that of the wall, times
  /// the fraction of the length that touches. So its force is the sum of the forces of its parts.
  /// If none touches, the outermost part counts.
  struct Parted {
    struct Part {
      int instrument = 0;
      double radius_mm = 0;  ///< of the instrument's surface
      double fraction = 0;   ///< of the point's length, > 0
    };
    int point = 0;
    int count = 0;     ///< number of parts, from the sheath on; the radius falls
    int touching = 0;  ///< number of those that touch: the first ones
    double acts = 1;   ///< sum of the fractions that count
    std::array<Part, kMostInstruments> parts;
  };
  std::array<Parted, kMostInstruments> parted;  ///< the first `parted_count` are valid
  int parted_count = 0;
  /// Energy of the wall at these points, in addition to that of their mean radius and stiffness,
  /// mJ.
  double parted_mJ = 0;

  /// Instruments whose common curve has the points.
  struct Instruments {
    int first = 0;  ///< the innermost on the curve
    int last = 1;   ///< one past the outermost on the curve
    /// Distance of the tip of each behind the end of the curve.
    std::array<double, kMostInstruments> behind_mm = {};
    /// One per segment: unit, across it; for a lone wire, fixed to its material. Empty if no
    /// instrument twists.
    std::vector<Eigen::Vector3d> normals;
    /// Angle of each instrument against these normals; one entry per segment. Empty for a lone
    /// wire.
    std::vector<std::array<double, kMostInstruments>> angles_rad;
  };
  Instruments instruments;

  /// Position of the curve among the others.
  struct AmongCurves {
    int curve = 0;  ///< number of the curve, from the innermost
    /// Number of points, from the sheath on, that lie in the lumen of another curve. They cannot
    /// touch the wall.
    int in_lumen = 0;
    /// For curves around others: squared radius of the curves inside at the same way from the
    /// sheath. It is a mean over the point's length, and 0 beyond their ends. Otherwise empty.
    std::vector<double> inside_mm2;
    bool is_farthest = true;        ///< the curve reaches farthest; of equals, the innermost
    double behind_farthest_mm = 0;  ///< distance of the curve's end behind that of the farthest
    bool beside_farthest = false;   ///< lies beside the farthest one, not within or around it
  };
  AmongCurves among;

  /// Contact between instruments, for terms that act between them.
  struct Between {
    /// Contact force of each instrument against the next one around it, N; one entry per segment.
    /// Only for a stack that twists, only if a term is a BetweenTerm. Updated when a
    /// part of the motion begins.
    std::vector<std::array<double, kMostInstruments>> pressed_N;
    /// Places in the lumen of a curve around this one, from the sheath to the mouth or the tip.
    /// Each segment has `per_segment` of them. Only if a term has BetweenTerm::SlidesInLumen.
    /// Otherwise empty.
    std::vector<LumenContact> lumen;
    /// Same for the places beside another curve of a higher number. A place that faces no segment
    /// has no force.
    std::vector<LumenContact> beside;
    /// Same for places that cross the order of those, and for places of the curve beside itself.
    /// They ascend by LumenContact::pair, and for each pair from the sheath.
    std::vector<LumenContact> crossing;
    int per_segment = 2;
  };
  Between between;

  int size() const { return static_cast<int>(position.size()); }
  int segments() const { return size() / per_segment; }
  /// Index of the point in the material: constant while the wire moves through the sheath.
  int FromTip(int q) const { return size() - 1 - q; }
  /// Normal of the segment of point q, fixed to the material of an instrument.
  Eigen::Vector3d NormalOf(int instrument, int q) const {
    const int i = q / per_segment;
    if (instruments.angles_rad.empty()) return instruments.normals[i];
    return TurnedAbout(Tangent(q), instruments.normals[i], instruments.angles_rad[i][instrument]);
  }
  /// Normal, as of NormalOf, of the surface that touches the wall at the point.
  Eigen::Vector3d Normal(int q) const { return NormalOf(SurfaceAt(q), q); }
  /// Parts of the point; null if it has one surface.
  const Parted* PartsOf(int q) const {
    for (int k = 0; k < parted_count; ++k) {
      if (parted[k].point == q) return &parted[k];
    }
    return nullptr;
  }
  /// The outermost instrument of the curve that reaches the point's length; its surface touches the
  /// wall.
  int SurfaceAt(int q) const {
    if (const Parted* parts = PartsOf(q)) return parts->parts[0].instrument;
    int k = instruments.last - 1;
    while (k > instruments.first && instruments.behind_mm[k] > FromTip(q) * spacing_mm) {
      --k;
    }
    return k;
  }
  /// Distance of the point from the tip of that instrument, mm.
  double FromTipOf(int instrument, int q) const {
    return FromTip(q) * spacing_mm - instruments.behind_mm[instrument];
  }
  /// Fraction of the point's length that the instrument covers, 0 .. 1: between 0 and 1 only near
  /// its tip.
  double CoverageOf(int instrument, int q) const {
    return CoverageUpTo(instruments.behind_mm[instrument], q);
  }
  /// The same up to a place, as a distance behind the distal end.
  double CoverageUpTo(double behind_mm, int q) const {
    const double before_mm = PieceMm(q) / 2;
    const double beyond_mm = q + 1 < size() ? PieceMm(q + 1) / 2 : 0;
    const double from_tip_mm = FromTipMm(q) - behind_mm;
    const double reached_mm = std::clamp(from_tip_mm, -before_mm, beyond_mm);
    return (before_mm + reached_mm) / (before_mm + beyond_mm);
  }
  /// Distance of the point from the distal end, mm.
  double FromTipMm(int q) const {
    const int in_first =
        std::max(0, per_segment - 1 - q);  // pieces with the first segment's spacing
    return (FromTip(q) - in_first) * spacing_mm + in_first * first_spacing_mm;
  }
  /// The length of the piece that ends in the point, mm.
  double PieceMm(int q) const { return q < per_segment ? first_spacing_mm : spacing_mm; }
  /// The unit tangent of the segment that the point belongs to.
  Eigen::Vector3d Tangent(int q) const {
    return (position[q] - (q == 0 ? start : position[q - 1])) / PieceMm(q);
  }

  /// Place between points: on the piece that ends in `point`, `before_mm` before that point.
  struct Place {
    int point;         ///< negative: past the sheath
    double before_mm;  ///< negative: beyond the point, on the line of its piece
  };
  /// Place at a distance from the distal end, >= 0. Snaps to a point within rounding.
  Place PlaceAt(double from_tip_mm) const {
    const double in_first_mm = from_tip_mm - (size() - per_segment) * spacing_mm;
    return in_first_mm > kRoundingMm ? PlaceOn(per_segment - 1, in_first_mm, first_spacing_mm)
                                     : PlaceOn(size() - 1, from_tip_mm, spacing_mm);
  }
  Eigen::Vector3d PositionAt(const Place& place) const {
    const Eigen::Vector3d& end = position[place.point];
    if (place.before_mm == 0) return end;
    return end - place.before_mm * Tangent(place.point);
  }

 private:
  static constexpr double kRoundingMm = 1e-9;
  static Place PlaceOn(int last_point, double before_mm, double piece_mm) {
    const int pieces = static_cast<int>((before_mm + kRoundingMm) / piece_mm);
    const double rest_mm = before_mm - pieces * piece_mm;
    return {last_point - pieces, rest_mm > kRoundingMm ? rest_mm : 0};
  }
};

}  // namespace torquer
