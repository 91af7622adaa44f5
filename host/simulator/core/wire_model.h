// Wire model: the properties of a wire that stay constant while it is simulated.
#pragma once

#include <Eigen/Core>
#include <algorithm>
#include <array>
#include <vector>

#include "host/simulator/core/bending.h"
#include "host/simulator/core/instrument_pose.h"
#include "host/simulator/core/wire_sections.h"

namespace torquer {

/// End of the introducer sheath: the wire enters the vessel there, and is clamped.
struct Sheath {
  Eigen::Vector3d point_mm = Eigen::Vector3d::Zero();
  Eigen::Vector3d direction = Eigen::Vector3d::UnitX();  ///< unit
};

/// Unit vector across a unit direction: the first normal of an unrotated wire in a sheath of that
/// direction.
Eigen::Vector3d SheathNormal(const Eigen::Vector3d& direction);

/// Unit direction of a segment whose joint is bent by an angle towards the first and second normal,
/// rad. Given in the frame (first normal, second normal, tangent).
Eigen::Vector3d BentDirection(const Eigen::Vector2d& angle_rad);

/// A wire cut into segments. The index is the number of segments between a node (or the joint at
/// it) and the distal end. It stays the same while the wire moves.
class WireModel {
 public:
  /// `sections` in ascending from_tip_mm, at least one; the last continues proximally without end.
  /// `tip_mm`: length of the tip, the part that the paper's method treats as curved; 0 for no tip.
  /// Throws std::invalid_argument naming the field, its value and the valid range.
  WireModel(double segment_mm, std::vector<WireSection> sections, double tip_mm,
            double max_length_mm, BendingLaw law, const Sheath& sheath);

  /// Properties of a joint, and of the segment distal of it.
  struct Joint {
    double rigidity_N_mm2;
    double radius_mm;
    Eigen::Vector2d rest_rad;  ///< rest angle, towards first and second normal
    /// Energy of a whole joint between instruments of different rest shape, which bend each other
    /// (README (38)). It changes with their poses only; 0 for instruments that twist.
    double mutual_mJ = 0;
  };
  /// Replaces all joints. Instruments that slide within each other need this after a move, because
  /// their sum changes (stack/instrument_stack.h). Joint k is `from_tip` k; the last continues
  /// proximally. `tip_segments`: the tip's length, like tip_mm, in segments. Only for a wire that
  /// does not twist. No heap.
  void ReplaceJoints(const std::vector<Joint>& joints, int tip_segments);

  /// Instruments, each with its own twist, at a joint of their common rod. The joint rests at the
  /// sum of bend_rad, each turned with its own instrument (README (30)).
  struct TwistingJoint {
    struct Contribution {
      /// Angle that the instrument adds to the rest angle of the rod, in the instrument's frame.
      Eigen::Vector2d bend_rad = Eigen::Vector2d::Zero();
      /// GJ, > 0. Continues beyond its tip, where no torque acts.
      double torsional_rigidity_N_mm2 = 0;
    };
    std::array<Contribution, kMostInstruments> of;  ///< by instrument
    /// Energy of two instruments of different rest shape that bend each other: constant - along
    /// cos(D) - across sin(D), mJ (README (38)). D is the angle from the normals of a to those of
    /// b. The constant is 0 only where both are straight.
    struct Mutual {
      double constant_mJ = 0;
      double along_mJ = 0;
      double across_mJ = 0;
    };
    std::array<std::array<Mutual, kMostInstruments>, kMostInstruments> mutual;  ///< [a][b], a < b
  };
  /// The same for `count` >= 1 instruments of a stack that twist; the innermost is number `first`.
  /// `twisting` has one entry for each of `joints`.
  void ReplaceJoints(const std::vector<Joint>& joints, const std::vector<TwistingJoint>& twisting,
                     int first, int count, int tip_segments);

  /// Sections of an instrument; not set for a rod.
  const std::vector<WireSection>& sections() const { return sections_; }
  double segment_mm() const { return segment_mm_; }        ///< lambda
  int tip_segments() const { return tip_segments_; }       ///< M of the paper
  int max_segments() const { return max_segments_; }       ///< n never exceeds this
  double max_length_mm() const { return max_length_mm_; }  ///< insertion never exceeds this
  BendingLaw law() const { return law_; }
  const Sheath& sheath() const { return sheath_; }
  /// Unit vector across the sheath's direction: the first normal there of an unrotated wire.
  const Eigen::Vector3d& sheath_normal() const { return sheath_normal_; }

  /// EI of the joint `from_tip` segments from the distal end, N mm^2.
  double rigidity_N_mm2(int from_tip) const { return rigidity_[Clamp(from_tip)]; }
  double radius_mm(int from_tip) const { return radius_[Clamp(from_tip)]; }
  /// Joint::mutual_mJ of the joint `from_tip` segments from the distal end; 0 for a lone wire.
  double mutual_mJ(int from_tip) const {
    return mutual_mJ_.empty() ? 0 : mutual_mJ_[Clamp(from_tip)];
  }
  /// True if the wire twists under a torque. Otherwise its distal end turns like the proximal one.
  bool twists() const { return !torsional_rigidity_.empty(); }
  /// Number of spins of a segment: 0 without twist, 1 for a lone wire that twists. A stack that
  /// twists has one for each instrument.
  int spins() const { return twists() ? 1 : stack_spins_; }
  /// True for a rod of instruments that twist, each by itself.
  bool stack_twists() const { return stack_spins_ > 0; }
  /// In such a rod: the instrument of the first spin of a segment. The other spins follow in order.
  int first_spin() const { return first_spin_; }
  /// Joint of such a rod.
  const TwistingJoint& twisting_joint(int from_tip) const { return twisting_[Clamp(from_tip)]; }
  /// GJ of the joint, N mm^2. Only for a wire that twists.
  double torsional_rigidity_N_mm2(int from_tip) const {
    return torsional_rigidity_[Clamp(from_tip)];
  }
  /// Joints at and beyond this distance from the tip rest straight.
  int first_straight_joint() const { return first_straight_; }
  /// Upper bound of first_straight_joint().
  int most_curved_joints() const { return most_curved_; }
  /// Rest direction of the distal segment of a joint, a unit vector. Its frame is (untwisted
  /// normal, second normal, tangent) of the proximal segment. It is (0, 0, 1) from
  /// first_straight_joint() on.
  const Eigen::Vector3d& rest_direction(int from_tip) const {
    return rest_direction_[Clamp(from_tip)];
  }

 private:
  std::size_t Clamp(int from_tip) const {
    return std::min(static_cast<std::size_t>(from_tip), rigidity_.size() - 1);
  }

  std::vector<WireSection> sections_;
  double segment_mm_;
  double max_length_mm_;
  int tip_segments_;
  int max_segments_;
  int first_straight_ = 0;
  int most_curved_ = 0;
  BendingLaw law_;
  Sheath sheath_;
  Eigen::Vector3d sheath_normal_;
  std::vector<double> rigidity_;
  std::vector<double> radius_;
  std::vector<double> mutual_mJ_;           // empty for a lone wire
  std::vector<double> torsional_rigidity_;  // empty for a wire that does not twist
  std::vector<TwistingJoint> twisting_;     // for a stack that twists
  int stack_spins_ = 0;
  int first_spin_ = 0;
  std::vector<Eigen::Vector3d> rest_direction_;
};

}  // namespace torquer
