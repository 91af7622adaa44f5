// The wire as it lies now, and how it is moved by hand.
#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <vector>

#include "host/simulator/core/wire_model.h"

namespace torquer {

/// Nodes 0 .. n from the sheath to the distal end; segment i joins nodes i and i + 1.
///
/// Segment 0 is first_segment_mm long, in [lambda/2, 3 lambda/2); all others lambda. A node keeps
/// its distance from the distal end, so it is a fixed point of the wire's material; feeding
/// lengthens segment 0 and now and then splits it. With less than lambda/2 inserted there is no
/// segment (n = 0).
struct WireState {
  /// Reserves room for model.max_segments(), so that nothing here allocates later. n = 0.
  explicit WireState(const WireModel& model);

  int segments() const { return static_cast<int>(tangents.size()); }  ///< n
  double SegmentLength(const WireModel& model, int i) const {
    return i == 0 ? first_segment_mm : model.segment_mm();
  }
  /// Arc length of the polyline past the sheath, mm.
  double ArcLength(const WireModel& model) const;

  std::vector<Eigen::Vector3d> nodes;     ///< n + 1, mm
  std::vector<Eigen::Vector3d> tangents;  ///< n, unit
  /// n, unit, across the tangent. With the second normal, tangent x normal, it spans the
  /// cross-section in which steps are taken.
  std::vector<Eigen::Vector3d> normals;
  /// For joints that rest curved, by their distance from the tip in segments: cosine and sine of
  /// the angle about the proximal tangent from its normal to the untwisted one, which is the
  /// sheath's carried along the wire by parallel transport. The wire does not twist, so its rest
  /// shape is fixed to the untwisted normals (turned by rotation_rad).
  std::vector<Eigen::Vector2d> spin;
  /// For a wire that twists (model.twists()), whose normals are then fixed to its material: n, by
  /// joint, the angle about the tangent from the normal carried on from the proximal segment (or
  /// from the sheath, where it turns with the hand) to that of the distal one. Empty otherwise.
  std::vector<double> twist_rad;
  double first_segment_mm = 0;
  double insertion_mm = 0;     ///< material past the sheath: ArcLength() where n > 0
  double rotation_rad = 0;     ///< of the proximal end; turns the rest shape about the tangents
  Eigen::Vector2d turn{1, 0};  ///< cosine and sine of rotation_rad

  void SetRotation(double rotation);
};

/// Carries a unit vector across unit `from` to one across unit `to` by the smallest rotation that
/// takes `from` to `to`; where they are opposite, by half a turn about the vector itself.
Eigen::Vector3d ParallelTransport(const Eigen::Vector3d& normal, const Eigen::Vector3d& from,
                                  const Eigen::Vector3d& to);

/// Gives segment i another tangent; its normal goes along.
void TurnSegment(std::size_t i, const Eigen::Vector3d& tangent, WireState& state);
/// Makes all normals untwisted ones, with no spin or twist between.
void TransportNormals(const WireModel& model, WireState& state);
/// Cosine and sine of the angle about `to` from `normal`, carried there from `from` by parallel
/// transport, to `target_normal`, taken backwards: what this joint adds to the spin.
Eigen::Vector2d SpinFactor(const Eigen::Vector3d& from, const Eigen::Vector3d& normal,
                           const Eigen::Vector3d& to, const Eigen::Vector3d& target_normal);
/// Recomputes the spin from tangents and normals, or the twist of a wire that twists. A twist is
/// taken within half a turn of what it was.
void UpdateSpin(const WireModel& model, WireState& state);
/// Turns all normals of a wire that twists about their tangents, as a rotation of the hand does
/// that meets no resistance.
void TurnNormals(double angle_rad, WireState& state);
/// Recomputes nodes from `first` (at least 1) on from tangents and lengths.
void PlaceNodes(const WireModel& model, int first, WireState& state);

/// Direction, unit, in which the distal segment of joint i (between segments i - 1 and i, or the
/// sheath and segment 0) rests.
Eigen::Vector3d RestDirection(const WireModel& model, const WireState& state, int joint);

/// Fits segment 0 to insertion_mm, which the caller has changed by at most lambda/2; splits it in
/// two or joins it with the next one when it leaves its range. The caller places the nodes and
/// updates the spin afterwards. No heap.
void FeedFirstSegment(const WireModel& model, WireState& state);

/// Feeds `delta_mm` (negative: retracts), |delta_mm| <= lambda/2: the wire slides along itself, its
/// tip goes on straight. No heap. Returns the part that could be fed (less at either end of the
/// range 0 .. model.max_length_mm()).
double FeedAlongItself(const WireModel& model, double delta_mm, WireState& state);

/// Lays a wire of `length_mm` along a path given as points, the first at the sheath; the last
/// direction is kept past the path's end. Lengths are exact, the wire follows within a segment.
void LayAlong(const WireModel& model, const std::vector<Eigen::Vector3d>& path_mm, double length_mm,
              WireState& state);

/// FNV-1a, by 64-bit words, over the exact bits of the state.
std::uint64_t HashState(const WireState& state);

}  // namespace torquer
