// Wire sections: the properties of an instrument along its length, and their integrals over joints.
#pragma once

#include <Eigen/Core>
#include <vector>

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

/// A joint by the sections of its wire: their integrals over the joint's hat. The hat's weight w(s)
/// rises from 0 at one neighboring joint to 1 at the joint itself and falls to 0 at the other. So
/// sections may end anywhere, and the shape still converges with the square of the segment (README
/// (2)).
struct JointOfSections {
  double rigidity_N_mm2 = 0;  ///< segment length over the integral of w / EI
  /// Integral of w times the rest curvature, towards the first and second normal.
  Eigen::Vector2d rest_rad = Eigen::Vector2d::Zero();
  /// Segment length over the integral of w / GJ; 0 for a wire that does not twist.
  double torsional_rigidity_N_mm2 = 0;
};

/// Joint at a distance from the distal end, where the first section continues.
JointOfSections IntegrateJoint(const std::vector<WireSection>& sections, double from_tip_mm,
                               double segment_mm);

}  // namespace torquer
