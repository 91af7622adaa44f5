#include "host/simulator/core/curve.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <cassert>
#include <cmath>

#include "host/simulator/core/hash.h"

namespace torquer {

using Eigen::Vector2d;
using Eigen::Vector3d;

namespace {

// Conjugate of a unit complex number: the opposite angle.
Vector2d Conjugate(const Vector2d& a) { return {a[0], -a[1]}; }

// Angle from its cosine and sine; small angles avoid the library function.
double Angle(double cosine, double sine) {
  const double square = sine * sine;
  if (!(cosine > 0) || square > 4e-3) return std::atan2(sine, cosine);
  // asin as a series; the omitted terms are below 1e-15 of the sum.
  return sine * (1 + square * (1.0 / 6 +
                               square * (3.0 / 40 + square * (5.0 / 112 + square * 35.0 / 1152))));
}

}  // namespace

Curve::Curve(const WireModel& model, int instruments) : poses_(instruments) {
  const auto room = static_cast<std::size_t>(model.max_segments()) + 2;
  nodes_.reserve(room);
  tangents_.reserve(room);
  normals_.reserve(room);
  if (model.spins() > 0) {
    twist_rad_.reserve(room);
    if (model.stack_twists()) turns_rad_.reserve(room);
  } else {
    reference_twist_.assign(model.most_curved_joints() + 1, Vector2d(1, 0));
  }
  nodes_.push_back(model.sheath().point_mm);
}

void Curve::LayAlong(const WireModel& model, const std::vector<Vector3d>& path_mm,
                     const InstrumentPoses& poses, double reach_mm) {
  const double lambda = model.segment_mm();
  tangents_.clear();
  normals_.clear();
  poses_ = poses;
  insertion_mm_ = std::clamp(reach_mm, 0.0, model.max_length_mm());
  if (poses.size() == 1) {
    poses_[0].insertion_mm = insertion_mm_;
    Rotate(poses[0].rotation_rad);
  }
  const int n = insertion_mm_ < lambda / 2
                    ? 0
                    : std::max(1, static_cast<int>(std::floor(insertion_mm_ / lambda + 0.5)));
  first_segment_mm_ = n == 0 ? insertion_mm_ : insertion_mm_ - (n - 1) * lambda;

  // Follow-the-leader: the next node is the point at which the path leaves the sphere around the
  // last node.
  std::size_t leg = 0;
  Vector3d at = model.sheath().point_mm;
  Vector3d direction = model.sheath().direction;
  for (int i = 0; i < n; ++i) {
    const double length = SegmentLength(model, i);
    while (leg < path_mm.size() && (path_mm[leg] - at).norm() < length) ++leg;
    if (leg < path_mm.size()) {
      const Vector3d& b = path_mm[leg];
      const Vector3d a = leg == 0 ? at : path_mm[leg - 1];
      // |a + t (b - a) - at| = length with t in (0, 1]; a is inside the sphere, b is not.
      const Vector3d ab = b - a;
      const Vector3d ta = a - at;
      const double p = ab.squaredNorm();
      const double q = ab.dot(ta);
      const double r = ta.squaredNorm() - length * length;
      const double t = (-q + std::sqrt(std::max(0.0, q * q - p * r))) / p;
      const Vector3d reach = a + t * ab - at;
      if (reach.norm() > 1e-9 * length) direction = reach.normalized();
    }
    tangents_.push_back(direction);
    at += length * direction;
  }
  PlaceNodes(model, 1);
  UntwistFrames(model);
}

double Curve::ArcLength(const WireModel& model) const {
  return segments() == 0 ? 0 : first_segment_mm_ + (segments() - 1) * model.segment_mm();
}

Vector3d Curve::ProximalNormal(const WireModel& model) const {
  const Vector3d& normal = model.sheath_normal();
  if (!model.twists()) return normal;
  return turn_[0] * normal + turn_[1] * model.sheath().direction.cross(normal);
}

void Curve::PlaceNodes(const WireModel& model, int first) {
  const int n = segments();
  nodes_.resize(n + 1);
  for (int i = first; i <= n; ++i) {
    nodes_[i] = nodes_[i - 1] + SegmentLength(model, i - 1) * tangents_[i - 1];  // (1)
  }
}

void Curve::UntwistFrames(const WireModel& model) {
  const int n = segments();
  normals_.resize(n);
  Vector3d tangent = model.sheath().direction;
  Vector3d normal = ProximalNormal(model);
  for (int i = 0; i < n; ++i) {
    normal = ParallelTransport(normal, tangent, tangents_[i]);
    tangent = tangents_[i];
    normals_[i] = normal;
  }
  std::fill(reference_twist_.begin(), reference_twist_.end(), Vector2d(1, 0));
  if (model.spins() > 0) twist_rad_.assign(n, 0);
  if (model.stack_twists()) turns_rad_.assign(n, Rotations());
}

void Curve::Rebuild(const WireModel& model) {
  PlaceNodes(model, 1);
  UpdateFrames(model);
}

void Curve::SetDirections(const WireModel& model, const std::vector<Vector3d>& tangents,
                          const std::vector<Vector3d>& normals) {
  assert(tangents.size() == tangents_.size() && normals.size() == tangents_.size());
  tangents_ = tangents;
  normals_ = normals;
  PlaceNodes(model, 1);
}

void Curve::LayThrough(const WireModel& model, const std::vector<Vector3d>& points_mm, int first) {
  for (int j = first + 1; j <= segments(); ++j) {
    tangents_[j - 1] = (points_mm[j] - points_mm[j - 1]).normalized();
  }
  PlaceNodes(model, first + 1);
  UntwistFrames(model);
}

void Curve::UpdateTwist(const WireModel& model) {
  constexpr double kTurn = 2 * 3.14159265358979323846;
  const int n = segments();
  Vector3d from = model.sheath().direction;
  Vector3d normal = ProximalNormal(model);
  for (int i = 0; i < n; ++i) {
    const Vector2d turn = FrameTurn(from, normal, tangents_[i], normals_[i]);
    const double angle = Angle(turn[0], -turn[1]);
    const double apart = twist_rad_[i] - angle;
    twist_rad_[i] = std::abs(apart) < kTurn / 2 ? angle : angle + kTurn * std::round(apart / kTurn);
    from = tangents_[i];
    normal = normals_[i];
  }
}

PerInstrument Curve::Rotations() const {
  PerInstrument rotations = {};
  for (int k = 0; k < poses_.size(); ++k) {
    rotations[k] = poses_[k].rotation_rad;
  }
  return rotations;
}

void Curve::UpdateFrames(const WireModel& model) {
  if (model.spins() > 0) {
    UpdateTwist(model);
    return;
  }
  const int n = segments();
  const int curved = model.first_straight_joint();
  if (curved <= 1) return;
  // (11). Angles about successive tangents add up, and each factor depends on one joint alone.
  Vector2d product(1, 0);
  const Vector3d* from = &model.sheath().direction;
  const Vector3d* normal = &model.sheath_normal();
  for (int i = 0; i < n; ++i) {
    if (n - i < curved) reference_twist_[n - i] = product.normalized();
    const Vector3d* const to = &tangents_[i];
    const Vector3d* const to_normal = &normals_[i];
    product = Turned(product, FrameTurn(*from, *normal, *to, *to_normal));
    // Occasional normalization suffices, because each factor is off only by rounding.
    if (i % 32 == 31) product.normalize();
    from = to;
    normal = to_normal;
  }
}

void Curve::Rotate(double rotation_rad) {
  if (!twist_rad_.empty() && turns_rad_.empty()) {
    const double c = std::cos(rotation_rad - rotation_rad_);
    const double s = std::sin(rotation_rad - rotation_rad_);
    for (std::size_t i = 0; i < normals_.size(); ++i) {
      normals_[i] = c * normals_[i] + s * tangents_[i].cross(normals_[i]);
    }
  }
  rotation_rad_ = rotation_rad;
  turn_ << std::cos(rotation_rad), std::sin(rotation_rad);
  if (poses_.size() == 1) poses_[0].rotation_rad = rotation_rad;
}

void Curve::TurnDistal(const WireModel& model, const std::vector<Vector3d>& tangents) {
  assert(tangents.size() <= tangents_.size());
  std::size_t i = tangents_.size();
  for (const Vector3d& tangent : tangents) {
    --i;
    normals_[i] = ParallelTransport(normals_[i], tangents_[i], tangent);
    tangents_[i] = tangent;
  }
  Rebuild(model);
}

// Updates the reference twist of the joints beyond a segment whose tangent has changed.
void Curve::TurnReference(const WireModel& model, int segment, const Vector3d& old_tangent,
                          const Vector3d& old_normal) {
  const int n = segments();
  const int curved = model.first_straight_joint();
  if (curved <= 1) return;
  const Vector3d& before = segment == 0 ? model.sheath().direction : tangents_[segment - 1];
  const Vector3d& normal = segment == 0 ? model.sheath_normal() : normals_[segment - 1];
  const Vector3d& tangent = tangents_[segment];
  const Vector3d& own = normals_[segment];
  Vector2d change = Turned(FrameTurn(before, normal, tangent, own),
                           Conjugate(FrameTurn(before, normal, old_tangent, old_normal)));
  for (int joint = segment + 1; joint < n; ++joint) {
    if (joint == segment + 2) {
      const Vector3d& after = tangents_[segment + 1];
      const Vector3d& target = normals_[segment + 1];
      change = Turned(change, Turned(FrameTurn(tangent, own, after, target),
                                     Conjugate(FrameTurn(old_tangent, old_normal, after, target))));
      joint = std::max(joint, n - curved + 1);
      if (joint >= n) return;
    }
    const int from_tip = n - joint;
    if (from_tip < curved) reference_twist_[from_tip] = Turned(reference_twist_[from_tip], change);
  }
}

void Curve::TurnSegment(const WireModel& model, int segment, const Vector3d& tangent) {
  const Vector3d old_tangent = tangents_[segment];
  const Vector3d old_normal = normals_[segment];
  tangents_[segment] = tangent;
  normals_[segment] = ParallelTransport(old_normal, old_tangent, tangent);
  TurnReference(model, segment, old_tangent, old_normal);
  const Vector3d move = SegmentLength(model, segment) * (tangent - old_tangent);
  for (int j = segment + 1; j <= segments(); ++j) nodes_[j] += move;
}

void Curve::Step(const WireModel& model, const Curve& from, const std::vector<Frame>& frames,
                 const std::vector<Vector2d>& xi_of, const std::vector<double>& spin,
                 double scale) {
  const auto n = from.tangents_.size();
  const int spins = model.spins();
  const auto first_spin = static_cast<std::size_t>(model.first_spin());
  tangents_.resize(n);
  normals_.resize(n);
  first_segment_mm_ = from.first_segment_mm_;
  insertion_mm_ = from.insertion_mm_;
  rotation_rad_ = from.rotation_rad_;
  turn_ = from.turn_;
  poses_ = from.poses_;
  reference_twist_ = from.reference_twist_;
  twist_rad_ = from.twist_rad_;
  turns_rad_ = from.turns_rad_;
  for (std::size_t i = 0; i < n; ++i) {
    const Vector3d& u = from.tangents_[i];
    const Vector2d xi = scale * xi_of[i];
    const Vector3d longer = u + frames[i] * xi;  // (4)
    const double length = longer.norm();
    const Vector3d tangent = longer / length;
    // ParallelTransport(normal, u, tangent), with scalar products that are known here.
    const Vector3d carried = from.normals_[i] - (xi[0] / (1 + length)) * (u + tangent);
    const Vector3d normal = carried - carried.dot(tangent) * tangent;
    tangents_[i] = tangent;
    normals_[i] = normal * (1.5 - 0.5 * normal.squaredNorm());
    if (model.twists()) {
      const Vector3d spun = normals_[i] + (scale * spin[i]) * tangent.cross(normals_[i]);
      normals_[i] = spun / spun.norm();
    } else {
      for (int k = 0; k < spins; ++k) {
        turns_rad_[i][first_spin + k] += scale * spin[i * spins + k];
      }
    }
  }
  PlaceNodes(model, 1);
  UpdateFrames(model);
}

void Curve::TakeStep(Curve& stepped) {
  std::swap(nodes_, stepped.nodes_);
  std::swap(tangents_, stepped.tangents_);
  std::swap(normals_, stepped.normals_);
  std::swap(reference_twist_, stepped.reference_twist_);
  std::swap(twist_rad_, stepped.twist_rad_);
  std::swap(turns_rad_, stepped.turns_rad_);
}

namespace {

// Rest direction of a joint that stands for the fraction `part` of a segment.
Vector3d FractionOfRest(const Vector3d& rest, double fraction) {
  const double across = std::hypot(rest[0], rest[1]);
  if (across == 0) return rest;
  const double angle = fraction * std::atan2(across, rest[2]);
  const double scale = std::sin(angle) / across;
  return {scale * rest[0], scale * rest[1], std::cos(angle)};
}

}  // namespace

Vector2d TwistedRest(const WireModel& model, const Curve& curve, int joint) {
  const WireModel::TwistingJoint& twisting = model.twisting_joint(curve.segments() - joint);
  Vector2d rest = Vector2d::Zero();
  for (int k = model.first_spin(); k < model.first_spin() + model.spins(); ++k) {
    const auto& share = twisting.of[k];
    if (share.bend_rad.isZero(0)) continue;
    const double turn = curve.TurnBefore(joint, k);
    rest += Turned({std::cos(turn), std::sin(turn)}, share.bend_rad);
  }
  return JointLength(model, curve, joint) / model.segment_mm() * rest;
}

Vector3d RestDirection(const WireModel& model, const Curve& curve, int joint) {
  const Vector3d& tangent = joint == 0 ? model.sheath().direction : curve.tangents()[joint - 1];
  const int from_tip = curve.segments() - joint;
  if (from_tip >= model.first_straight_joint()) return tangent;
  const Vector3d first = joint == 0 ? curve.ProximalNormal(model) : curve.normals()[joint - 1];
  const Vector3d second = tangent.cross(first);
  if (model.stack_twists()) {
    const Vector3d rest = BentDirection(TwistedRest(model, curve, joint));
    return rest[2] * tangent + rest[0] * first + rest[1] * second;
  }
  double c = 1;
  double s = 0;
  if (!model.twists()) {
    const Vector2d& twist = curve.reference_twist()[from_tip];
    const Vector2d& turn = curve.turn();
    c = turn[0] * twist[0] - turn[1] * twist[1];
    s = turn[1] * twist[0] + turn[0] * twist[1];
  }
  Vector3d rest = model.rest_direction(from_tip);
  // Near the sheath the length of a joint differs from the length of a segment (see JointLength).
  if (joint <= 1) {
    const double fraction = curve.first_segment_mm() / model.segment_mm();
    rest = FractionOfRest(rest, joint == 0 ? fraction / 2 : (fraction + 1) / 2);
  }
  return rest[2] * tangent + (c * rest[0] - s * rest[1]) * first +
         (s * rest[0] + c * rest[1]) * second;
}

std::uint64_t HashCurve(const Curve& curve) {
  std::uint64_t hash = HashVectors(curve.nodes(), kHashSeed);
  hash = HashVectors(curve.tangents(), hash);
  hash = HashVectors(curve.normals(), hash);
  for (const Eigen::Vector2d& twist : curve.reference_twist()) {
    hash = HashDouble(twist[1], HashDouble(twist[0], hash));
  }
  for (const double twist : curve.twist_rad()) hash = HashDouble(twist, hash);
  for (const PerInstrument& turns : curve.turns_rad()) {
    for (const double turn : turns) hash = HashDouble(turn, hash);
  }
  hash = HashDouble(curve.first_segment_mm(), hash);
  hash = HashDouble(curve.insertion_mm(), hash);
  hash = HashDouble(curve.rotation_rad(), hash);
  for (const InstrumentPose& pose : curve.poses()) {
    hash = HashDouble(pose.rotation_rad, HashDouble(pose.insertion_mm, hash));
  }
  return hash;
}

}  // namespace torquer
