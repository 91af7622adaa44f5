#include "host/simulator/core/wire_model.h"

#include <algorithm>
#include <cassert>
#include <cmath>
#include <stdexcept>
#include <string>
#include <utility>

namespace torquer {
namespace {

[[noreturn]] void Refuse(const std::string& field, double value, const std::string& range) {
  throw std::invalid_argument(field + " is " + std::to_string(value) + "; it must be " + range);
}

void CheckPositive(const std::string& field, double value) {
  if (!(value > 0) || !std::isfinite(value)) Refuse(field, value, "a positive number");
}

}  // namespace

Eigen::Vector3d SheathNormal(const Eigen::Vector3d& direction) {
  Eigen::Index smallest = 0;
  direction.cwiseAbs().minCoeff(&smallest);
  const Eigen::Vector3d axis = Eigen::Vector3d::Unit(smallest);
  return (axis - axis.dot(direction) * direction).normalized();
}

Eigen::Vector3d BentDirection(const Eigen::Vector2d& angle_rad) {
  const double angle = angle_rad.norm();
  if (!(angle > 0)) return {0, 0, 1};
  const Eigen::Vector2d across = angle_rad * (std::sin(angle) / angle);
  return {across[0], across[1], std::cos(angle)};
}

WireModel::WireModel(double segment_mm, std::vector<WireSection> sections, double tip_mm,
                     double max_length_mm, BendingLaw law, const Sheath& sheath)
    : sections_(std::move(sections)),
      segment_mm_(segment_mm),
      max_length_mm_(max_length_mm),
      law_(law),
      sheath_(sheath) {
  CheckPositive("segment_mm", segment_mm);
  CheckPositive("max_length_mm", max_length_mm);
  if (!(tip_mm >= 0) || !std::isfinite(tip_mm)) Refuse("tip_mm", tip_mm, "zero or more");
  if (max_length_mm / segment_mm > 1e6) {
    Refuse("max_length_mm / segment_mm", max_length_mm / segment_mm, "at most 1e6 segments");
  }
  if (sections_.empty()) throw std::invalid_argument("a wire needs at least one section");
  double previous = -1;
  for (const WireSection& s : sections_) {
    if (!(s.from_tip_mm >= 0) || !std::isfinite(s.from_tip_mm) || s.from_tip_mm <= previous) {
      Refuse("section from_tip_mm", s.from_tip_mm, "zero or more, and ascending");
    }
    previous = s.from_tip_mm;
    CheckPositive("section rigidity_N_mm2", s.rigidity_N_mm2);
    CheckPositive("section radius_mm", s.radius_mm);
    const bool twists = sections_.front().torsional_rigidity_N_mm2 != 0;
    if (twists) CheckPositive("section torsional_rigidity_N_mm2", s.torsional_rigidity_N_mm2);
    if (!twists && s.torsional_rigidity_N_mm2 != 0) {
      Refuse("section torsional_rigidity_N_mm2", s.torsional_rigidity_N_mm2,
             "0 where that of the first section is");
    }
    const double angle = segment_mm * std::hypot(s.curvature_1_per_mm, s.curvature_2_per_mm);
    if (!(angle <= 1.5)) Refuse("rest curvature times segment_mm", angle, "at most 1.5 rad");
  }
  if (!sheath.point_mm.allFinite() || !(std::abs(sheath.direction.norm() - 1) < 1e-9)) {
    throw std::invalid_argument("the sheath needs a finite point and a unit direction");
  }

  tip_segments_ = static_cast<int>(std::lround(tip_mm / segment_mm));
  max_segments_ = static_cast<int>(std::ceil(max_length_mm / segment_mm)) + 1;
  // The hat of the last joint lies in the last section, which continues.
  const int tabulated =
      std::min(max_segments_, static_cast<int>(sections_.back().from_tip_mm / segment_mm) + 2);
  RodJoints joints(sections_, segment_mm);
  for (int k = 0; k <= tabulated; ++k) {
    const double from_tip_mm = k * segment_mm;
    const JointIntegrals& joint = joints.At(k);
    const Eigen::Vector2d& rest_rad = joint.bend_rad.front();
    rigidity_.push_back(joint.rigidity_N_mm2);
    radius_.push_back(SectionAt(sections_, from_tip_mm).radius_mm);
    const double torsional = JointTorsionalRigidity(sections_, from_tip_mm, segment_mm);
    if (torsional > 0) torsional_rigidity_.push_back(torsional);
    // The joint at the distal end (k = 0) has no distal segment.
    if (!rest_rad.isZero(0)) first_straight_ = k + 1;
    rest_direction_.push_back(BentDirection(rest_rad));
  }
  // If the last section is curved, the wire is curved up to its proximal end.
  if (rest_direction_.back()[2] != 1) first_straight_ = max_segments_ + 1;
  most_curved_ = std::min(first_straight_, max_segments_);
  sheath_normal_ = SheathNormal(sheath.direction);
}

void WireModel::ReplaceJoints(const std::vector<Joint>& joints, int tip_segments) {
  assert(!twists() && !joints.empty());
  const std::size_t count = joints.size();
  most_curved_ = max_segments_;
  rigidity_.resize(count);
  radius_.resize(count);
  rest_direction_.resize(count);
  mutual_mJ_.resize(count);
  first_straight_ = 0;
  for (std::size_t k = 0; k < count; ++k) {
    rigidity_[k] = joints[k].rigidity_N_mm2;
    radius_[k] = joints[k].radius_mm;
    mutual_mJ_[k] = joints[k].mutual_mJ;
    rest_direction_[k] = BentDirection(joints[k].rest_rad);
    if (!joints[k].rest_rad.isZero(0)) first_straight_ = static_cast<int>(k) + 1;
  }
  if (rest_direction_.back()[2] != 1) first_straight_ = max_segments_ + 1;
  tip_segments_ = tip_segments;
}

void WireModel::ReplaceJoints(const std::vector<Joint>& joints,
                              const std::vector<TwistingJoint>& twisting, int first, int count,
                              int tip_segments) {
  assert(count >= 1 && joints.size() == twisting.size());
  ReplaceJoints(joints, tip_segments);
  twisting_ = twisting;
  stack_spins_ = count;
  first_spin_ = first;
  // Rests that cancel at the present rotations need not cancel after a turn.
  first_straight_ = 0;
  for (std::size_t k = 0; k < twisting.size(); ++k) {
    for (const TwistingJoint::Contribution& from : twisting[k].of) {
      if (!from.bend_rad.isZero(0)) first_straight_ = static_cast<int>(k) + 1;
    }
  }
  if (first_straight_ == static_cast<int>(twisting.size())) first_straight_ = max_segments_ + 1;
}

}  // namespace torquer
