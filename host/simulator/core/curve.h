// Curve: the shape of one or more instruments that lie on each other without room, and its motions.
#pragma once

#include <Eigen/Core>
#include <array>
#include <cstdint>
#include <vector>

#include "host/simulator/core/frames.h"
#include "host/simulator/core/instrument_pose.h"
#include "host/simulator/core/wire_model.h"

namespace torquer {

/// A number for each instrument of a stack.
using PerInstrument = std::array<double, kMostInstruments>;

/// The tangent plane of a segment: its normal and second normal (tangent x normal) as columns.
using Frame = Eigen::Matrix<double, 3, 2, Eigen::RowMajor>;

/// Nodes 0 .. n from the sheath to the distal end; segment i joins nodes i and i + 1.
///
/// Segment 0 is first_segment_mm() long, in [lambda/2, 3 lambda/2); all others lambda. A node keeps
/// its distance from the distal end, so it is a fixed point of the wire's material. Feeding
/// lengthens segment 0 and sometimes splits it. With less than lambda/2 inserted there is no
/// segment (n = 0).
///
/// Every member function leaves a consistent wire: unit tangents, unit normals across them, exact
/// lengths, and nodes from these. The model argument is always the model that the curve was made
/// for. No function allocates after construction.
class Curve {
 public:
  /// n = 0; room for model.max_segments(). `instruments`: number of instruments of the wire.
  explicit Curve(const WireModel& model, int instruments = 1);

  // Contents.

  int segments() const { return static_cast<int>(tangents_.size()); }         ///< n
  const std::vector<Eigen::Vector3d>& nodes() const { return nodes_; }        ///< n + 1, mm
  const Eigen::Vector3d& tip() const { return nodes_.back(); }                ///< mm
  const std::vector<Eigen::Vector3d>& tangents() const { return tangents_; }  ///< n, unit
  /// n, unit, across the tangent. Together with the second normal, tangent x normal, it spans the
  /// tangent plane of the steps. For a wire that twists, fixed to its material.
  const std::vector<Eigen::Vector3d>& normals() const { return normals_; }
  /// Reference twist: an angle, as cosine and sine, for joints that rest curved. Its index is the
  /// joint's distance from the tip in segments. The angle turns about the proximal tangent from its
  /// normal to the untwisted one. The untwisted normal is the sheath's, carried along the wire by
  /// parallel transport. A wire that does not twist has its rest shape fixed to the untwisted
  /// normals, turned by rotation_rad().
  const std::vector<Eigen::Vector2d>& reference_twist() const { return reference_twist_; }
  /// For a wire or a stack that twists: n, by joint, an angle about the tangent. It turns the
  /// normal that is carried over from the proximal segment to the normal of the distal segment. At
  /// joint 0 the sheath's normal is used, which turns with the hand of a lone wire. Otherwise
  /// empty.
  const std::vector<double>& twist_rad() const { return twist_rad_; }
  /// Only for a stack that twists: n entries. Angles about the tangent from the segment's normal to
  /// the first normal of each instrument on this curve. The first normal is fixed to the
  /// instrument's material. Otherwise empty.
  const std::vector<PerInstrument>& turns_rad() const { return turns_rad_; }
  /// First normal of the surface of an instrument on this curve, in a segment. It is fixed to the
  /// instrument's material if it twists.
  Eigen::Vector3d SurfaceNormal(int segment, int instrument) const {
    if (turns_rad_.empty()) return normals_[segment];
    return TurnedAbout(tangents_[segment], normals_[segment], turns_rad_[segment][instrument]);
  }
  /// The angle of turns_rad() in the segment before joint i, or in the sheath.
  double TurnBefore(int joint, int instrument) const {
    return joint == 0 ? poses_[instrument].rotation_rad : turns_rad_[joint - 1][instrument];
  }
  /// Twist, rad, at joint i of an instrument on this curve.
  double TwistOf(int joint, int instrument) const {
    if (turns_rad_.empty()) return twist_rad_[joint];
    return twist_rad_[joint] + turns_rad_[joint][instrument] - TurnBefore(joint, instrument);
  }
  double first_segment_mm() const { return first_segment_mm_; }
  double SegmentLength(const WireModel& model, int i) const {
    return i == 0 ? first_segment_mm_ : model.segment_mm();
  }
  /// Arc length of the polyline past the sheath, mm.
  double ArcLength(const WireModel& model) const;
  /// Insertion and rotation of each instrument.
  const InstrumentPoses& poses() const { return poses_; }
  /// Reach of the wire past the sheath, mm; equals ArcLength() if n > 0.
  double insertion_mm() const { return insertion_mm_; }
  /// Rotation of the proximal end, and with it of the rest shape. 0 for several instruments: the
  /// stack turns the rest shape of each (stack/instrument_stack.h).
  double rotation_rad() const { return rotation_rad_; }
  const Eigen::Vector2d& turn() const { return turn_; }  ///< cosine and sine of rotation_rad()
  /// First normal of the wire in the sheath.
  Eigen::Vector3d ProximalNormal(const WireModel& model) const;

  // Motions.

  /// Lays the curve along a path of points, the first after the sheath. Past the path's end it
  /// keeps the last direction. The curve reaches `reach_mm`, at most model.max_length_mm(). It
  /// follows the path within a segment. Frames are untwisted.
  void LayAlong(const WireModel& model, const std::vector<Eigen::Vector3d>& path_mm,
                const InstrumentPoses& poses, double reach_mm);
  /// Sets the poses of the instruments, without moving a node.
  void SetPoses(const InstrumentPoses& poses) { poses_ = poses; }
  /// Moves the instruments to `poses`. If that changes their reach, Feed must follow. An
  /// instrument that twists slides along the wire, which Feed moves afterwards. It turns as a
  /// whole, which is its resting position without external load.
  void MoveInstruments(const WireModel& model, const InstrumentPoses& poses);
  /// Feeds the wire until `to_mm` of it are inside: 0 .. model.max_length_mm(). The wire slides
  /// along itself, by at most lambda/2 at once, and its tip goes straight on (README (23)).
  void Feed(const WireModel& model, double to_mm);
  /// Like Feed, but as a push at the sheath: the shape moves on as it lies. Frames are untwisted.
  void FeedAtBase(const WireModel& model, double to_mm);
  /// Turns the proximal end. A wire that twists turns as a whole, which is its resting position
  /// without external load.
  void Rotate(double rotation_rad);
  /// Turns the most distal segments to the given unit tangents, ordered from the tip. Normals
  /// follow by parallel transport.
  void TurnDistal(const WireModel& model, const std::vector<Eigen::Vector3d>& tangents);
  /// Turns one segment to a unit tangent and moves everything distal to it rigidly. The reference
  /// twist is updated by increments. Rebuild removes the rounding errors that many calls
  /// accumulate.
  void TurnSegment(const WireModel& model, int segment, const Eigen::Vector3d& tangent);
  /// Recomputes nodes and frames from tangents and normals.
  void Rebuild(const WireModel& model);
  /// Replaces all normals by untwisted ones: no reference twist, no twist.
  void UntwistFrames(const WireModel& model);
  /// Replaces tangents and normals, n each, unit and across. The reference twist stays unchanged;
  /// see UpdateFrames.
  void SetDirections(const WireModel& model, const std::vector<Eigen::Vector3d>& tangents,
                     const std::vector<Eigen::Vector3d>& normals);
  /// Lays the segments from `first` on in the directions between successive points, one per node.
  /// Frames are untwisted.
  void LayThrough(const WireModel& model, const std::vector<Eigen::Vector3d>& points_mm, int first);
  /// Inserts a segment of length lambda before segment `at`; the wire's reach grows by lambda.
  /// Frames are untwisted.
  void InsertSegment(const WireModel& model, int at, const Eigen::Vector3d& tangent);
  /// Removes a segment of length lambda, or the last one. Frames are untwisted.
  void RemoveSegment(const WireModel& model, int at);

  /// Sets this curve to `from` after the step `scale` times xi, one per segment, in the planes
  /// `frames` (README (4)). With twist it also applies `scale` times `spin`, turns about the
  /// tangent, model.spins() per segment.
  void Step(const WireModel& model, const Curve& from, const std::vector<Frame>& frames,
            const std::vector<Eigen::Vector2d>& xi, const std::vector<double>& spin, double scale);
  /// Exchanges nodes, tangents, normals, reference twist and twist with a curve that Step made from
  /// this one.
  void TakeStep(Curve& stepped);
  /// Updates the reference twist, or the twist of a wire that twists, from tangents and normals
  /// (README (11)). The new twist is within half a turn of the old one.
  void UpdateFrames(const WireModel& model);

 private:
  void PlaceNodes(const WireModel& model, int first);
  void TurnTo(int segment, const Eigen::Vector3d& direction);
  void Slide(const WireModel& model, double fed_mm);
  void BendSplit(const WireModel& model);
  void FitFirstSegment(const WireModel& model);
  void SplitFirst(const WireModel& model);
  void JoinFirst(const WireModel& model);
  void SplitTwist();
  void JoinTwist(double fraction);
  PerInstrument Rotations() const;
  void UpdateTwist(const WireModel& model);
  void TurnReference(const WireModel& model, int segment, const Eigen::Vector3d& old_tangent,
                     const Eigen::Vector3d& old_normal);

  std::vector<Eigen::Vector3d> nodes_;
  std::vector<Eigen::Vector3d> tangents_;
  std::vector<Eigen::Vector3d> normals_;
  std::vector<Eigen::Vector2d> reference_twist_;
  std::vector<double> twist_rad_;
  std::vector<PerInstrument> turns_rad_;
  double first_segment_mm_ = 0;
  double insertion_mm_ = 0;
  double rotation_rad_ = 0;
  Eigen::Vector2d turn_{1, 0};
  InstrumentPoses poses_;
};

/// Rest direction, unit, of the distal segment of joint i. The joint lies between segments i - 1
/// and i, or between the sheath and segment 0.
Eigen::Vector3d RestDirection(const WireModel& model, const Curve& curve, int joint);

/// Rest angle of joint i in a stack that twists, towards the first and second normal before it,
/// rad.
Eigen::Vector2d TwistedRest(const WireModel& model, const Curve& curve, int joint);

/// Length of wire that joint i stands for, mm: half a segment at the sheath, which clamps the wire
/// there. Elsewhere it is the mean of its two segments (README (2)).
inline double JointLength(const WireModel& model, const Curve& curve, int joint) {
  const double lambda = model.segment_mm();
  if (joint > 1) return lambda;
  return joint == 1 ? (curve.first_segment_mm() + lambda) / 2 : curve.first_segment_mm() / 2;
}

/// Length of wire that node i > 0 represents, mm: half of each neighboring segment. At the distal
/// end this is half a segment.
inline double NodeLength(const WireModel& model, const Curve& curve, int node) {
  const double beyond_mm = node < curve.segments() ? model.segment_mm() : 0;
  return (curve.SegmentLength(model, node - 1) + beyond_mm) / 2;
}

/// EI of joint i over its JointLength, mJ (N mm).
inline double JointStiffness(const WireModel& model, const Curve& curve, int joint) {
  return model.rigidity_N_mm2(curve.segments() - joint) / JointLength(model, curve, joint);
}

/// GJ of joint i of a lone wire that twists, over its JointLength, mJ.
inline double TwistStiffness(const WireModel& model, const Curve& curve, int joint) {
  return model.torsional_rigidity_N_mm2(curve.segments() - joint) /
         JointLength(model, curve, joint);
}

/// FNV-1a, by 64-bit words, over the exact bits of the curve.
std::uint64_t HashCurve(const Curve& curve);

}  // namespace torquer
