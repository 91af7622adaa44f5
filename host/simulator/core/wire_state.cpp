#include "host/simulator/core/wire_state.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <cassert>
#include <cmath>
#include <cstring>

namespace torquer {

using Eigen::Vector3d;

WireState::WireState(const WireModel& model) {
  const auto room = static_cast<std::size_t>(model.max_segments()) + 2;
  nodes.reserve(room);
  tangents.reserve(room);
  normals.reserve(room);
  if (model.twists()) {
    twist_rad.reserve(room);
  } else {
    spin.assign(static_cast<std::size_t>(model.most_curved_joints()) + 1, Eigen::Vector2d(1, 0));
  }
  nodes.push_back(model.sheath().point_mm);
}

void WireState::SetRotation(double rotation) {
  rotation_rad = rotation;
  turn << std::cos(rotation), std::sin(rotation);
}

double WireState::ArcLength(const WireModel& model) const {
  return segments() == 0 ? 0 : first_segment_mm + (segments() - 1) * model.segment_mm();
}

Vector3d ParallelTransport(const Vector3d& normal, const Vector3d& from, const Vector3d& to) {
  const double one_plus_cos = 1 + from.dot(to);
  if (one_plus_cos < 1e-12) return normal;
  // Rotation about from x to, in a form without trigonometry; valid because normal is across from.
  const Vector3d carried = normal - (normal.dot(to) / one_plus_cos) * (from + to);
  // Removes what rounding adds along `to` and to the length, so that both stay at rounding.
  const Vector3d across = carried - carried.dot(to) * to;
  if (one_plus_cos < 0.1) return across.normalized();  // where rounding is large
  return across * (1.5 - 0.5 * across.squaredNorm());
}

void TurnSegment(std::size_t i, const Vector3d& tangent, WireState& state) {
  state.normals[i] = ParallelTransport(state.normals[i], state.tangents[i], tangent);
  state.tangents[i] = tangent;
}

namespace {

// The normal of the wire in the sheath.
Vector3d ProximalNormal(const WireModel& model, const WireState& state) {
  const Vector3d& normal = model.sheath_normal();
  if (!model.twists()) return normal;
  return state.turn[0] * normal + state.turn[1] * model.sheath().direction.cross(normal);
}

Vector3d Rotated(const Vector3d& normal, const Vector3d& tangent, double angle) {
  return std::cos(angle) * normal + std::sin(angle) * tangent.cross(normal);
}

}  // namespace

void TransportNormals(const WireModel& model, WireState& state) {
  const int n = state.segments();
  state.normals.resize(static_cast<std::size_t>(n));
  Vector3d tangent = model.sheath().direction;
  Vector3d normal = ProximalNormal(model, state);
  for (int i = 0; i < n; ++i) {
    normal = ParallelTransport(normal, tangent, state.tangents[i]);
    tangent = state.tangents[i];
    state.normals[i] = normal;
  }
  std::fill(state.spin.begin(), state.spin.end(), Eigen::Vector2d(1, 0));
  if (model.twists()) state.twist_rad.assign(static_cast<std::size_t>(n), 0);
}

Eigen::Vector2d SpinFactor(const Vector3d& from, const Vector3d& normal, const Vector3d& to,
                           const Vector3d& target_normal) {
  const double one_plus_cos = 1 + from.dot(to);
  const Vector3d carried =
      one_plus_cos < 1e-12 ? normal : normal - (normal.dot(to) / one_plus_cos) * (from + to);
  return {carried.dot(target_normal), carried.dot(to.cross(target_normal))};
}

namespace {

// The angle with a cosine and a sine; without the library's function where it is small.
double Angle(double cosine, double sine) {
  const double square = sine * sine;
  if (!(cosine > 0) || square > 4e-3) return std::atan2(sine, cosine);
  // asin as a series; what is left out is below 1e-15 of the sum.
  return sine * (1 + square * (1.0 / 6 +
                               square * (3.0 / 40 + square * (5.0 / 112 + square * 35.0 / 1152))));
}

void UpdateTwist(const WireModel& model, WireState& state) {
  constexpr double kTurn = 2 * 3.14159265358979323846;
  const int n = state.segments();
  Vector3d from = model.sheath().direction;
  Vector3d normal = ProximalNormal(model, state);
  for (int i = 0; i < n; ++i) {
    const Eigen::Vector2d turn = SpinFactor(from, normal, state.tangents[i], state.normals[i]);
    const double angle = Angle(turn[0], -turn[1]);
    const double apart = state.twist_rad[i] - angle;
    state.twist_rad[i] =
        std::abs(apart) < kTurn / 2 ? angle : angle + kTurn * std::round(apart / kTurn);
    from = state.tangents[i];
    normal = state.normals[i];
  }
}

}  // namespace

void TurnNormals(double angle_rad, WireState& state) {
  const double c = std::cos(angle_rad);
  const double s = std::sin(angle_rad);
  for (std::size_t i = 0; i < state.normals.size(); ++i) {
    state.normals[i] = c * state.normals[i] + s * state.tangents[i].cross(state.normals[i]);
  }
}

void UpdateSpin(const WireModel& model, WireState& state) {
  if (model.twists()) {
    UpdateTwist(model, state);
    return;
  }
  const int n = state.segments();
  const int curved = model.first_straight_joint();
  if (curved <= 1) return;
  // Angles about successive tangents add up; as unit complex numbers their factors multiply, and
  // each factor depends on one joint alone.
  Eigen::Vector2d sum(1, 0);
  for (int i = 0; i < n; ++i) {
    if (n - i < curved) state.spin[n - i] = sum.normalized();
    const Vector3d& from = i == 0 ? model.sheath().direction : state.tangents[i - 1];
    const Vector3d& normal = i == 0 ? model.sheath_normal() : state.normals[i - 1];
    const Eigen::Vector2d turn = SpinFactor(from, normal, state.tangents[i], state.normals[i]);
    sum = Eigen::Vector2d(sum[0] * turn[0] - sum[1] * turn[1], sum[0] * turn[1] + sum[1] * turn[0]);
    // Now and then is enough: a factor is off by rounding alone.
    if (i % 32 == 31) sum.normalize();
  }
}

void PlaceNodes(const WireModel& model, int first, WireState& state) {
  const int n = state.segments();
  state.nodes.resize(static_cast<std::size_t>(n) + 1);
  for (int i = first; i <= n; ++i) {
    state.nodes[i] = state.nodes[i - 1] + state.SegmentLength(model, i - 1) * state.tangents[i - 1];
  }
}

namespace {

// The rest direction of a joint that stands for `part` of a segment.
Vector3d PartOfRest(const Vector3d& rest, double part) {
  const double across = std::hypot(rest[0], rest[1]);
  if (across == 0) return rest;
  const double angle = part * std::atan2(across, rest[2]);
  const double scale = std::sin(angle) / across;
  return {scale * rest[0], scale * rest[1], std::cos(angle)};
}

}  // namespace

Vector3d RestDirection(const WireModel& model, const WireState& state, int joint) {
  const Vector3d& tangent = joint == 0 ? model.sheath().direction : state.tangents[joint - 1];
  const int from_tip = state.segments() - joint;
  if (from_tip >= model.first_straight_joint()) return tangent;
  const Vector3d first = joint == 0 ? ProximalNormal(model, state) : state.normals[joint - 1];
  const Vector3d second = tangent.cross(first);
  double c = 1;
  double s = 0;
  if (!model.twists()) {
    const Eigen::Vector2d& spin = state.spin[static_cast<std::size_t>(from_tip)];
    c = state.turn[0] * spin[0] - state.turn[1] * spin[1];
    s = state.turn[1] * spin[0] + state.turn[0] * spin[1];
  }
  Vector3d rest = model.rest_direction(from_tip);
  // Next to the sheath a joint stands for another length than a segment's (see JointStiffness).
  if (joint <= 1) {
    const double part = state.first_segment_mm / model.segment_mm();
    rest = PartOfRest(rest, joint == 0 ? part / 2 : (part + 1) / 2);
  }
  return rest[2] * tangent + (c * rest[0] - s * rest[1]) * first +
         (s * rest[0] + c * rest[1]) * second;
}

namespace {

// Segment 0 has become two. The same twist per length stays everywhere: the middles of the first
// two segments were at 3/4 and 2 of a segment's length, those of the three are at 1/4, 1 and 2.
void SplitTwist(WireState& state) {
  const Vector3d& tangent = state.tangents.front();
  const double back = state.twist_rad[0] * (2.0 / 3);
  const double on = state.tangents.size() > 2 ? state.twist_rad[1] * (1.0 / 5) : 0;
  state.normals[0] = Rotated(state.normals[0], tangent, -back);
  state.normals[1] = Rotated(state.normals[1], tangent, on);
  state.twist_rad[0] -= back;
  if (state.tangents.size() > 2) state.twist_rad[1] -= on;
  state.twist_rad.insert(state.twist_rad.begin() + 1, back + on);
}

// Segments 0 and 1 are about to become one, whose middle is `part` of the way from that of segment
// 1 to that of segment 0.
void JoinTwist(double part, WireState& state) {
  const double back = state.twist_rad[1] * part;
  state.normals[1] = Rotated(state.normals[1], state.tangents[1], -back);
  state.twist_rad[0] += state.twist_rad[1] - back;
  if (state.twist_rad.size() > 2) state.twist_rad[2] += back;
  state.twist_rad.erase(state.twist_rad.begin() + 1);
}

// With less than this no segment is simulated: so short a one would be stiffer than any other.
double ShortestFirst(const WireModel& model) { return model.segment_mm() / 2; }

}  // namespace

void FeedFirstSegment(const WireModel& model, WireState& state) {
  const double lambda = model.segment_mm();
  if (state.segments() == 0) {
    state.first_segment_mm = state.insertion_mm;
    if (state.insertion_mm >= ShortestFirst(model)) {
      state.tangents.push_back(model.sheath().direction);
      state.normals.assign(1, ProximalNormal(model, state));
      if (model.twists()) state.twist_rad.assign(1, 0);
    }
    return;
  }
  // From the insertion rather than by adding up: no drift, however often it is fed.
  state.first_segment_mm = state.insertion_mm - (state.segments() - 1) * lambda;
  if (state.first_segment_mm >= 1.5 * lambda) {
    state.first_segment_mm -= lambda;
    state.tangents.insert(state.tangents.begin(), state.tangents.front());
    state.normals.insert(state.normals.begin(), state.normals.front());
    if (model.twists()) SplitTwist(state);
  } else if (state.first_segment_mm < ShortestFirst(model)) {
    if (state.segments() == 1) {
      state.tangents.clear();
      state.normals.clear();
      state.twist_rad.clear();
      state.first_segment_mm = state.insertion_mm;
      return;
    }
    const Vector3d joined = state.first_segment_mm * state.tangents[0] + lambda * state.tangents[1];
    if (model.twists())
      JoinTwist(state.first_segment_mm / (state.first_segment_mm + lambda), state);
    state.tangents.erase(state.tangents.begin());
    state.normals.erase(state.normals.begin());
    // The two could be opposite only if the wire were folded at the sheath.
    if (joined.norm() > 1e-9 * lambda) TurnSegment(0, joined.normalized(), state);
    state.first_segment_mm += lambda;
  }
}

double FeedAlongItself(const WireModel& model, double delta_mm, WireState& state) {
  const double lambda = model.segment_mm();
  assert(std::abs(delta_mm) <= lambda / 2);
  const double target = std::clamp(state.insertion_mm + delta_mm, 0.0, model.max_length_mm());
  const double fed = target - state.insertion_mm;
  state.insertion_mm = target;

  // Node i slides by `fed` along the polyline, so each chord turns towards the next (or, when
  // retracting, the former) segment. The tip keeps its directions: it has its own rest shape.
  const int shaft = state.segments() - model.tip_segments();
  const double part = std::abs(fed) / lambda;
  if (fed > 0) {
    for (int i = 0; i + 1 < shaft; ++i) {
      const Vector3d chord = (1 - part) * state.tangents[i] + part * state.tangents[i + 1];
      const double norm = chord.norm();
      if (norm > 1e-3) TurnSegment(static_cast<std::size_t>(i), chord / norm, state);
    }
  } else {
    for (int i = shaft - 1; i > 0; --i) {
      const Vector3d chord = (1 - part) * state.tangents[i] + part * state.tangents[i - 1];
      const double norm = chord.norm();
      if (norm > 1e-3) TurnSegment(static_cast<std::size_t>(i), chord / norm, state);
    }
  }
  FeedFirstSegment(model, state);
  PlaceNodes(model, 1, state);
  UpdateSpin(model, state);
  return fed;
}

void LayAlong(const WireModel& model, const std::vector<Vector3d>& path_mm, double length_mm,
              WireState& state) {
  const double lambda = model.segment_mm();
  state = WireState(model);
  state.insertion_mm = std::clamp(length_mm, 0.0, model.max_length_mm());
  if (state.insertion_mm < ShortestFirst(model)) {
    state.first_segment_mm = state.insertion_mm;
    return;
  }
  const int n = std::max(1, static_cast<int>(std::floor(state.insertion_mm / lambda + 0.5)));
  state.first_segment_mm = state.insertion_mm - (n - 1) * lambda;

  // Follow the leader: the next node is where the path leaves the sphere around the last one.
  std::size_t leg = 0;
  Vector3d at = model.sheath().point_mm;
  Vector3d direction = model.sheath().direction;
  for (int i = 0; i < n; ++i) {
    const double length = i == 0 ? state.first_segment_mm : lambda;
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
    state.tangents.push_back(direction);
    at += length * direction;
  }
  PlaceNodes(model, 1, state);
  TransportNormals(model, state);
}

std::uint64_t HashState(const WireState& state) {
  std::uint64_t hash = 0xcbf29ce484222325ULL;
  // By 64-bit words rather than bytes: eight times fewer steps, and it runs every tick.
  const auto add = [&hash](double value) {
    std::uint64_t bits = 0;
    std::memcpy(&bits, &value, sizeof bits);
    hash ^= bits;
    hash *= 0x100000001b3ULL;
  };
  for (const Vector3d& x : state.nodes) {
    add(x[0]);
    add(x[1]);
    add(x[2]);
  }
  for (const Vector3d& u : state.tangents) {
    add(u[0]);
    add(u[1]);
    add(u[2]);
  }
  for (const double twist : state.twist_rad) add(twist);
  add(state.first_segment_mm);
  add(state.insertion_mm);
  add(state.rotation_rad);
  return hash;
}

}  // namespace torquer
