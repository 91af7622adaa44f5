// Wire sections: an instrument's properties along its length, and their integrals over the joints
// of a rod of instruments.
#pragma once

#include <Eigen/Core>
#include <array>
#include <limits>
#include <vector>

#include "host/simulator/core/instrument_pose.h"

namespace torquer {

/// Properties of the wire at a distance from its distal end; linear in between.
struct WireSection {
  double from_tip_mm = 0;         ///< distance from the distal end along the wire, >= 0
  double rigidity_N_mm2 = 0;      ///< flexural rigidity EI, > 0
  double radius_mm = 0;           ///< > 0
  double curvature_1_per_mm = 0;  ///< intrinsic (rest) curvature towards the wire's first normal
  double curvature_2_per_mm = 0;  ///< same, towards its second normal
  /// Torsional rigidity GJ, > 0 everywhere; or 0 everywhere for a wire that does not twist at all.
  double torsional_rigidity_N_mm2 = 0;
};

/// Properties at a distance from the distal end. The first and the last section continue without
/// end. `sections`: at least one, in ascending from_tip_mm.
WireSection SectionAt(const std::vector<WireSection>& sections, double from_tip_mm);

/// Integrals over the hat of a joint. The hat's weight w(s) is 1 at the joint itself. It falls to 0
/// at both neighboring joints. Pieces along s act in series, members at the same s in parallel. So
/// sections and tips may lie anywhere. The shape still converges with the square of the segment
/// (README (2), (30)).
struct JointIntegrals {
  double rigidity_N_mm2 = 0;  ///< segment length over the integral of w / sum(EI)
  /// By member: integral of w EI / sum(EI) over the segment length. The member's part of a moment.
  std::array<double, kMostInstruments> share = {};
  /// By member, in its own frame: integral of w EI kappa / sum(EI). Their sum is the rest angle.
  std::array<Eigen::Vector2d, kMostInstruments> bend_rad;

  /// Two members that bend each other with g = EI_a EI_b / sum(EI), if both have the normals of
  /// their tips.
  struct Pair {
    double constant_mJ = 0;  ///< integral of w g (kappa_a^2 + kappa_b^2) / 2
    double along_mJ = 0;     ///< integral of w g kappa_a . kappa_b
    double across_mJ = 0;    ///< integral of w g kappa_a . kappa_b turned by a quarter
    Eigen::Vector2d of_a_mJ_mm =
        Eigen::Vector2d::Zero();  ///< integral of w g kappa_a, in a's frame
    Eigen::Vector2d of_b_mJ_mm =
        Eigen::Vector2d::Zero();  ///< integral of w g kappa_b, in b's frame
  };
  /// Entry [a][b], a < b; zero where both are straight.
  std::array<std::array<Pair, kMostInstruments>, kMostInstruments> pairs;
};

/// Instruments of a rod and the joints that they make.
class RodJoints {
 public:
  struct Member {
    const std::vector<WireSection>* sections = nullptr;
    double behind_mm = 0;  ///< distance of its tip behind the rod's end, >= 0
    /// Its last place, as a distance from the rod's end: see EndInSheath. The first member has
    /// none.
    double until_mm = std::numeric_limits<double>::infinity();
  };

  /// Joints of one instrument.
  RodJoints(const std::vector<WireSection>& sections, double segment_mm);
  /// Joints of `count` >= 1 members in order of decreasing reach. The first ends where the rod
  /// ends. The sections must outlive this.
  RodJoints(const std::array<Member, kMostInstruments>& members, int count, double segment_mm);

  /// The joint that is `from_tip` segments from the rod's end, where the first member continues.
  /// The reference is valid until the next call. No heap.
  const JointIntegrals& At(int from_tip);

 private:
  double NextKink(double from_mm, double before_mm) const;

  std::array<Member, kMostInstruments> members_;
  std::size_t count_;
  double segment_mm_;
  double uniform_from_mm_;     // no property of a member changes from here on
  double none_ends_until_mm_;  // no member ends in the sheath up to here ..
  double none_ends_from_mm_;   // .. and none does from here on
  bool uniform_ = false;       // joint_ is one beyond uniform_from_mm_
  JointIntegrals joint_;
};

/// Last place of an instrument in the hat of the joint at the sheath, from the rod's end. Half of
/// that hat lies in the sheath. The instrument counts there as far as in the other half. So with
/// its tip at the sheath it does not count. No limit from two segments past the sheath on.
double EndInSheath(double behind_mm, double inserted_mm, double segment_mm);

/// GJ of a joint of one instrument, N mm^2: segment length over the integral of w / GJ. Zero for an
/// instrument that does not twist. The first section continues beyond the tip.
double JointTorsionalRigidity(const std::vector<WireSection>& sections, double from_tip_mm,
                              double segment_mm);

}  // namespace torquer
