// The wire as it lies now, and how it is moved.
#pragma once

#include <Eigen/Core>
#include <array>
#include <cstdint>
#include <vector>

#include "host/simulator/core/frames.h"
#include "host/simulator/core/instrument_place.h"
#include "host/simulator/core/wire_model.h"

namespace torquer {

/// A number for each instrument of a stack.
using OfInstruments = std::array<double, kMostInstruments>;

/// The tangent plane of a segment: its normal and second normal (tangent x normal) as columns.
using Frame = Eigen::Matrix<double, 3, 2, Eigen::RowMajor>;

/// Nodes 0 .. n from the sheath to the distal end; segment i joins nodes i and i + 1.
///
/// Segment 0 is first_segment_mm() long, in [lambda/2, 3 lambda/2); all others lambda. A node keeps
/// its distance from the distal end, so it is a fixed point of the wire's material; feeding
/// lengthens segment 0 and sometimes splits it. With less than lambda/2 inserted there is no
/// segment (n = 0).
///
/// Every member function leaves a whole wire: unit tangents, unit normals across them, exact
/// lengths, nodes that follow from both. Each takes the model that the state was made for. Nothing
/// allocates after construction.
class WireState {
 public:
  /// n = 0; room for model.max_segments(). `instruments`: how many the wire consists of.
  explicit WireState(const WireModel& model, int instruments = 1);
  /// Laid along a path given as points, the first after the sheath; the last direction is kept past
  /// the path's end. The wire reaches as far as the farthest of `places`, at most
  /// model.max_length_mm(); it follows the path within a segment. Frames are untwisted.
  static WireState Along(const WireModel& model, const std::vector<Eigen::Vector3d>& path_mm,
                         const InstrumentPlaces& places);

  // What there is.

  int segments() const { return static_cast<int>(tangents_.size()); }         ///< n
  const std::vector<Eigen::Vector3d>& nodes() const { return nodes_; }        ///< n + 1, mm
  const Eigen::Vector3d& tip() const { return nodes_.back(); }                ///< mm
  const std::vector<Eigen::Vector3d>& tangents() const { return tangents_; }  ///< n, unit
  /// n, unit, across the tangent. With the second normal, tangent x normal, it spans the
  /// cross-section in which steps are taken. Of a wire that twists, fixed to its material.
  const std::vector<Eigen::Vector3d>& normals() const { return normals_; }
  /// For joints that rest curved, by their distance from the tip in segments: cosine and sine of
  /// the angle about the proximal tangent from its normal to the untwisted one, which is the
  /// sheath's carried along the wire by parallel transport. A wire that does not twist has its rest
  /// shape fixed to the untwisted normals, turned by rotation_rad().
  const std::vector<Eigen::Vector2d>& reference_twist() const { return reference_twist_; }
  /// For a wire or a stack that twists: n, by joint, the angle about the tangent from the normal
  /// carried on from the proximal segment (or from the sheath, where it turns with the hand of a
  /// lone wire) to that of the distal one. Empty otherwise.
  const std::vector<double>& twist_rad() const { return twist_rad_; }
  /// For a stack that twists: n, the angle about the tangent from the normal of the segment to the
  /// first normal of each instrument on this curve, which is fixed to its material. Empty
  /// otherwise.
  const std::vector<OfInstruments>& turns_rad() const { return turns_rad_; }
  /// The same in the segment before joint i, or in the sheath.
  double TurnBefore(int joint, int instrument) const {
    return joint == 0 ? places_[instrument].rotation_rad
                      : turns_rad_[static_cast<std::size_t>(joint) - 1]
                                  [static_cast<std::size_t>(instrument)];
  }
  /// Twist, rad, at joint i of an instrument on this curve.
  double TwistOf(int joint, int instrument) const {
    const auto i = static_cast<std::size_t>(joint);
    if (turns_rad_.empty()) return twist_rad_[i];
    return twist_rad_[i] + turns_rad_[i][static_cast<std::size_t>(instrument)] -
           TurnBefore(joint, instrument);
  }
  double first_segment_mm() const { return first_segment_mm_; }
  double SegmentLength(const WireModel& model, int i) const {
    return i == 0 ? first_segment_mm_ : model.segment_mm();
  }
  /// Arc length of the polyline past the sheath, mm.
  double ArcLength(const WireModel& model) const;
  /// Where each instrument is.
  const InstrumentPlaces& places() const { return places_; }
  /// How far the wire reaches past the sheath, mm: ArcLength() where n > 0.
  double insertion_mm() const { return insertion_mm_; }
  /// By how much the proximal end and with it the rest shape are turned. Of several instruments 0:
  /// the stack turns the rest shape of each (stack/instrument_stack.h).
  double rotation_rad() const { return rotation_rad_; }
  const Eigen::Vector2d& turn() const { return turn_; }  ///< cosine and sine of rotation_rad()
  /// The first normal of the wire in the sheath.
  Eigen::Vector3d ProximalNormal(const WireModel& model) const;
  /// Of a stack that lies on two curves (stack/instrument_stack.h): the other curve, cut at the
  /// same lengths from the sheath. It has the segments into which its instruments reach; the last
  /// of them goes on to the length at which that of this curve ends. Null of all others.
  const WireState* second() const { return second_.empty() ? nullptr : &second_.front(); }
  /// Whether this curve is that of the outer instruments, and second() that of the inner ones.
  bool outer_leads() const { return outer_leads_; }
  /// The curve on which an instrument lies.
  const WireState& CurveOf(int instrument) const {
    if (second_.empty()) return *this;
    return (instrument >= first_outer_) == outer_leads_ ? *this : second_.front();
  }

  // How it moves.

  /// Sets where the instruments are, and moves nothing.
  void SetPlaces(const InstrumentPlaces& places) { places_ = places; }
  /// The instruments are here now. Feed must follow where that changes how far they reach. Where
  /// they twist, each slides along the wire, which is to be fed, and turns as a whole, which is
  /// where it comes to rest if nothing holds it.
  void MoveInstruments(const WireModel& model, const InstrumentPlaces& places);
  /// Feeds the wire to where `to_mm` of it are inside (0 .. model.max_length_mm(), at most lambda/2
  /// from where it is): it slides along itself, its tip goes on straight (README (23)).
  void Feed(const WireModel& model, double to_mm);
  /// The same as a push at the sheath: the shape moves on as it lies; frames are untwisted.
  void FeedAtBase(const WireModel& model, double to_mm);
  /// Turns the proximal end; of a wire that twists the whole of it, which is where it comes to rest
  /// if nothing holds it.
  void Rotate(double rotation_rad);
  /// Turns the most distal segments to unit tangents, given from the tip on; normals go along by
  /// parallel transport.
  void TurnDistal(const WireModel& model, const std::vector<Eigen::Vector3d>& tangents);
  /// Turns one segment to a unit tangent and moves all that is distal to it rigidly; the reference
  /// twist follows by increments. What rounding leaves after many is removed by PlaceAgain.
  void TurnSegment(const WireModel& model, int segment, const Eigen::Vector3d& tangent);
  /// Computes nodes and frames again from tangents and normals.
  void PlaceAgain(const WireModel& model);
  /// Makes all normals untwisted ones: no reference twist, no twist.
  void UntwistFrames(const WireModel& model);
  /// Gives the wire other tangents and normals, n each, unit and across. The reference twist stays
  /// as it is: see UpdateFrames.
  void SetDirections(const WireModel& model, const std::vector<Eigen::Vector3d>& tangents,
                     const std::vector<Eigen::Vector3d>& normals);
  /// Gives the segments from `first` on the directions between successive points, one a node;
  /// frames are untwisted.
  void LayThrough(const WireModel& model, const std::vector<Eigen::Vector3d>& points_mm, int first);
  /// Inserts a segment of length lambda before segment `at`; the wire reaches that much farther.
  /// Frames are untwisted.
  void InsertSegment(const WireModel& model, int at, const Eigen::Vector3d& tangent);
  /// Removes a segment of length lambda, or the last one. Frames are untwisted.
  void RemoveSegment(const WireModel& model, int at);

  /// Makes this the state `from` after the step `scale` times xi (one a segment, in the planes
  /// `frames`, README (4)) and, where something twists, `scale` times spin (turns about the
  /// tangent, model.spins() a segment).
  void Step(const WireModel& model, const WireState& from, const std::vector<Frame>& frames,
            const std::vector<Eigen::Vector2d>& xi, const std::vector<double>& spin, double scale);
  /// Exchanges nodes, tangents, normals, reference twist and twist with a state that Step made from
  /// this one.
  void TakeStep(WireState& stepped);
  /// Brings the reference twist, or the twist of a wire that twists, up to date with tangents and
  /// normals (README (11)). A twist is taken within half a turn of what it was.
  void UpdateFrames(const WireModel& model);

  // A second curve. `second`: the rod on it; `reach_mm`: how far its instruments reach.

  /// Lays a second curve on this one. `first_outer`: the innermost instrument on the outer curve.
  void LaySecond(const WireModel& second, double reach_mm, int first_outer, bool outer_leads);
  /// After Feed, with as many segments before it, by `fed_mm`: the second curve slides along itself
  /// by as much and is cut as this one, as far as its instruments reach. What is new at its end
  /// goes on straight.
  void FeedSecond(const WireModel& second, int segments_before, double fed_mm, double reach_mm);
  /// The second curve becomes this one, and this one the second. Both have as many segments. Frames
  /// must be brought up to date by UpdateCurves.
  void ExchangeCurves();
  /// UpdateFrames of both.
  void UpdateCurves(const WireModel& model, const WireModel& second);
  /// As Step, of the second curve.
  void StepSecond(const WireModel& second, const WireState& from, const std::vector<Frame>& frames,
                  const std::vector<Eigen::Vector2d>& xi, const std::vector<double>& spin,
                  double scale);
  /// As MoveInstruments, of both curves. FeedSecond must follow.
  void MoveBoth(const WireModel& model, const WireModel& second, const InstrumentPlaces& places);

 private:
  void PlaceNodes(const WireModel& model, int first);
  void Slide(const WireModel& model, double fed_mm);
  void FitFirstSegment(const WireModel& model);
  void SplitFirst(const WireModel& model);
  void JoinFirst(const WireModel& model);
  void FitEnd(const WireModel& model, int most, double reach_mm);
  void SplitTwist();
  void JoinTwist(double part);
  OfInstruments Rotations() const;
  void UpdateTwist(const WireModel& model);
  void TurnReference(const WireModel& model, int segment, const Eigen::Vector3d& old_tangent,
                     const Eigen::Vector3d& old_normal);

  std::vector<Eigen::Vector3d> nodes_;
  std::vector<Eigen::Vector3d> tangents_;
  std::vector<Eigen::Vector3d> normals_;
  std::vector<Eigen::Vector2d> reference_twist_;
  std::vector<double> twist_rad_;
  std::vector<OfInstruments> turns_rad_;
  double first_segment_mm_ = 0;
  double insertion_mm_ = 0;
  double rotation_rad_ = 0;
  Eigen::Vector2d turn_{1, 0};
  InstrumentPlaces places_;
  std::vector<WireState> second_;  // none or one
  int first_outer_ = 0;
  bool outer_leads_ = false;
};

/// Direction, unit, in which the distal segment of joint i (between segments i - 1 and i, or the
/// sheath and segment 0) rests.
Eigen::Vector3d RestDirection(const WireModel& model, const WireState& state, int joint);

/// Of a stack that twists: the angle by which joint i rests bent, towards the first and second
/// normal before it, rad.
Eigen::Vector2d TwistedRest(const WireModel& model, const WireState& state, int joint);

/// The length of wire that joint i stands for, mm: half a segment at the sheath, which clamps the
/// wire there, and the mean of its two segments elsewhere (README (2)).
inline double JointLength(const WireModel& model, const WireState& state, int joint) {
  const double lambda = model.segment_mm();
  if (joint > 1) return lambda;
  return joint == 1 ? (state.first_segment_mm() + lambda) / 2 : state.first_segment_mm() / 2;
}

/// The length of wire that node i > 0 stands for, mm: half of the segments on either side of it, so
/// half a segment at the distal end.
inline double NodeLength(const WireModel& model, const WireState& state, int node) {
  const double beyond_mm = node < state.segments() ? model.segment_mm() : 0;
  return (state.SegmentLength(model, node - 1) + beyond_mm) / 2;
}

/// EI of joint i over that length, mJ (N mm).
inline double JointStiffness(const WireModel& model, const WireState& state, int joint) {
  return model.rigidity_N_mm2(state.segments() - joint) / JointLength(model, state, joint);
}

/// GJ of joint i of a lone wire that twists over that length, mJ.
inline double TwistStiffness(const WireModel& model, const WireState& state, int joint) {
  return model.torsional_rigidity_N_mm2(state.segments() - joint) /
         JointLength(model, state, joint);
}

/// FNV-1a, by 64-bit words, over the exact bits of the state.
std::uint64_t HashState(const WireState& state);

}  // namespace torquer
