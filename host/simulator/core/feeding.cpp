// Feeding of a curve: README, section 8.
#include <algorithm>
#include <cassert>
#include <cmath>

#include "host/simulator/core/curve.h"

namespace torquer {

using Eigen::Vector3d;

namespace {

// Number of equal steps of at most `longest_mm` that cover a motion of `mm`.
int StepsOf(double mm, double longest_mm) {
  constexpr double kRounding = 1e-9;  // of a step
  return std::max(1, static_cast<int>(std::ceil(std::abs(mm) / longest_mm - kRounding)));
}

}  // namespace

// Splits the twist after segment 0 was split in two. The twist per length stays the same
// everywhere. The middles of the first two segments were at 3/4 and 2 segment lengths. The middles
// of the three are at 1/4, 1 and 2.
void Curve::SplitTwist() {
  const Vector3d tangent = tangents_.front();
  const double back = twist_rad_[0] * (2.0 / 3);
  const double on = tangents_.size() > 2 ? twist_rad_[1] * (1.0 / 5) : 0;
  normals_[0] = TurnedAbout(tangent, normals_[0], -back);
  normals_[1] = TurnedAbout(tangent, normals_[1], on);
  twist_rad_[0] -= back;
  if (tangents_.size() > 2) twist_rad_[1] -= on;
  twist_rad_.insert(twist_rad_.begin() + 1, back + on);
  if (turns_rad_.empty()) return;
  // The instruments' twists against the frames that were just turned.
  turns_rad_.insert(turns_rad_.begin(), turns_rad_.front());
  for (int k = 0; k < poses_.size(); ++k) {
    const double before = turns_rad_[1][k] - poses_[k].rotation_rad;
    const double beyond = turns_rad_.size() > 2 ? turns_rad_[2][k] - turns_rad_[1][k] : 0;
    turns_rad_[0][k] -= before * (2.0 / 3);
    turns_rad_[1][k] += beyond * (1.0 / 5);
  }
}

// Joins the twist before segments 0 and 1 are joined. From the middle of segment 1 to that of
// segment 0, the joined segment's middle lies at the fraction `part`.
void Curve::JoinTwist(double fraction) {
  const double back = twist_rad_[1] * fraction;
  normals_[1] = TurnedAbout(tangents_[1], normals_[1], -back);
  twist_rad_[0] += twist_rad_[1] - back;
  if (twist_rad_.size() > 2) twist_rad_[2] += back;
  twist_rad_.erase(twist_rad_.begin() + 1);
  if (turns_rad_.empty()) return;
  for (std::size_t k = 0; k < turns_rad_[0].size(); ++k) {
    turns_rad_[1][k] -= (turns_rad_[1][k] - turns_rad_[0][k]) * fraction;
  }
  turns_rad_.erase(turns_rad_.begin());
}

void Curve::MoveInstruments(const WireModel& model, const InstrumentPoses& poses) {
  const int n = segments();
  const int first = model.first_spin();
  const auto reach_mm = [&](const InstrumentPoses& of) {
    double reach = 0;
    for (int k = first; k < first + model.spins(); ++k) reach = std::max(reach, of[k].insertion_mm);
    return reach;
  };
  const double fed_mm = reach_mm(poses) - reach_mm(poses_);
  for (int k = first; model.stack_twists() && k < first + model.spins(); ++k) {
    const double slid_mm = poses[k].insertion_mm - poses_[k].insertion_mm - fed_mm;
    const int steps = StepsOf(slid_mm, model.segment_mm());
    const auto fraction = [&](int joint) {
      return std::min(1.0, std::abs(slid_mm) / steps / JointLength(model, *this, joint));
    };
    // The twist slides along with the instrument's material, distally or proximally.
    for (int step = 0; step < steps; ++step) {
      if (slid_mm > 0) {
        for (int i = n - 1; i >= 0; --i) turns_rad_[i][k] -= fraction(i) * TwistOf(i, k);
      } else if (slid_mm < 0) {
        for (int i = 0; i + 1 < n; ++i) turns_rad_[i][k] += fraction(i + 1) * TwistOf(i + 1, k);
      }
    }
    const double turned_rad = poses[k].rotation_rad - poses_[k].rotation_rad;
    for (PerInstrument& turns : turns_rad_) turns[k] += turned_rad;
  }
  SetPoses(poses);
}

// Fits segment 0 to insertion_mm_, which has changed by at most lambda/2. Outside its length range
// the segment is split in two or joined with the next one.
void Curve::FitFirstSegment(const WireModel& model) {
  const double lambda = model.segment_mm();
  const double shortest = lambda / 2;  // a shorter one would be stiffer than any other
  if (segments() == 0) {
    first_segment_mm_ = insertion_mm_;
    if (insertion_mm_ >= shortest) {
      tangents_.push_back(model.sheath().direction);
      normals_.assign(1, ProximalNormal(model));
      if (model.spins() > 0) twist_rad_.assign(1, 0);
      if (model.stack_twists()) turns_rad_.assign(1, Rotations());
    }
    return;
  }
  // Computed from the insertion rather than by increments: no drift, however often the wire is fed.
  first_segment_mm_ = insertion_mm_ - (segments() - 1) * lambda;
  if (first_segment_mm_ >= 1.5 * lambda) {
    SplitFirst(model);
  } else if (first_segment_mm_ < shortest) {
    if (segments() == 1) {
      tangents_.clear();
      normals_.clear();
      twist_rad_.clear();
      turns_rad_.clear();
      first_segment_mm_ = insertion_mm_;
      return;
    }
    JoinFirst(model);
  }
}

void Curve::SplitFirst(const WireModel& model) {
  first_segment_mm_ -= model.segment_mm();
  tangents_.insert(tangents_.begin(), tangents_.front());
  normals_.insert(normals_.begin(), normals_.front());
  if (model.spins() > 0) SplitTwist();
}

// Joins the first two segments; needs at least two.
void Curve::JoinFirst(const WireModel& model) {
  const double lambda = model.segment_mm();
  const Vector3d joined = first_segment_mm_ * tangents_[0] + lambda * tangents_[1];
  if (model.spins() > 0) JoinTwist(first_segment_mm_ / (first_segment_mm_ + lambda));
  tangents_.erase(tangents_.begin());
  normals_.erase(normals_.begin());
  // The two could be opposite only if the wire were folded at the sheath.
  if (joined.norm() > 1e-9 * lambda) {
    const Vector3d tangent = joined.normalized();
    normals_[0] = ParallelTransport(normals_[0], tangents_[0], tangent);
    tangents_[0] = tangent;
  }
  first_segment_mm_ += lambda;
}

// Turns a segment to a direction of any length. Its normal follows.
void Curve::TurnTo(int segment, const Vector3d& direction) {
  const double norm = direction.norm();
  if (!(norm > 1e-3)) return;
  const Vector3d tangent = direction / norm;
  normals_[segment] = ParallelTransport(normals_[segment], tangents_[segment], tangent);
  tangents_[segment] = tangent;
}

void Curve::Slide(const WireModel& model, double fed_mm) {
  // (23). The middle of the first segment moves by half of the feed, because the sheath holds its
  // proximal end. The tip keeps its directions, because it has its own rest shape.
  const int shaft = segments() - model.tip_segments();
  Vector3d behind = model.sheath().direction;  // before the feed
  for (int i = 0; i < shaft; ++i) {
    const bool last = i + 1 == shaft;
    if (last && fed_mm > 0) return;
    const Vector3d old = tangents_[i];
    const double before_mm = JointLength(model, *this, i);
    const Vector3d before = (old - behind) / before_mm;  // curvature of the joint
    if (i == 0) {
      TurnTo(i, old + fed_mm / 2 * before);
    } else if (last) {
      TurnTo(i, old + fed_mm * before);
    } else {
      const double beyond_mm = JointLength(model, *this, i + 1);
      const Vector3d beyond = (tangents_[i + 1] - old) / beyond_mm;
      const double growth = fed_mm * fed_mm / (before_mm + beyond_mm);
      TurnTo(i, old + fed_mm / 2 * (before + beyond) + growth * (beyond - before));
    }
    behind = old;
  }
}

// Bends the first two segments after segment 0 was split in two. The three joints get the curvature
// that is linear between the two joints before.
void Curve::BendSplit(const WireModel& model) {
  const double lambda = model.segment_mm();
  const Vector3d old = tangents_[0];
  TurnTo(0, lambda * model.sheath().direction + first_segment_mm_ * old);
  if (segments() > 2) TurnTo(1, 2 * lambda * old + first_segment_mm_ * tangents_[2]);
}

void Curve::Feed(const WireModel& model, double to_mm) {
  assert(to_mm >= 0 && to_mm <= model.max_length_mm());
  for (int left = StepsOf(to_mm - insertion_mm_, model.segment_mm() / 2); left > 0; --left) {
    const double target = insertion_mm_ + (to_mm - insertion_mm_) / left;
    Slide(model, target - insertion_mm_);
    insertion_mm_ = target;
    const int before = segments();
    FitFirstSegment(model);
    if (before > 0 && segments() > before) BendSplit(model);
  }
  insertion_mm_ = to_mm;
  if (poses_.size() == 1) poses_[0].insertion_mm = to_mm;
  Rebuild(model);
}

void Curve::FeedAtBase(const WireModel& model, double to_mm) {
  insertion_mm_ = to_mm;
  if (poses_.size() == 1) poses_[0].insertion_mm = to_mm;
  FitFirstSegment(model);
  PlaceNodes(model, 1);
  UntwistFrames(model);
}

void Curve::InsertSegment(const WireModel& model, int at, const Vector3d& tangent) {
  // A segment inserted at the sheath precedes the short first one only in name. Each length stays
  // with its position in the curve, and position 0 keeps its length.
  if (segments() == 0) {
    first_segment_mm_ = model.segment_mm();
    insertion_mm_ = 0;
  }
  tangents_.insert(tangents_.begin() + at, tangent);
  insertion_mm_ += model.segment_mm();
  if (poses_.size() == 1) poses_[0].insertion_mm = insertion_mm_;
  PlaceNodes(model, 1);
  UntwistFrames(model);
}

void Curve::RemoveSegment(const WireModel& model, int at) {
  const bool last = segments() == 1;
  tangents_.erase(tangents_.begin() + at);
  insertion_mm_ = last ? 0 : insertion_mm_ - model.segment_mm();
  if (last) first_segment_mm_ = 0;
  if (poses_.size() == 1) poses_[0].insertion_mm = insertion_mm_;
  PlaceNodes(model, 1);
  UntwistFrames(model);
}

}  // namespace torquer
