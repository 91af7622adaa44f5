// Wire state: the present shape of all instruments.
#pragma once

#include <cstdint>
#include <vector>

#include "host/simulator/core/curve.h"

namespace torquer {

/// Curves of the instruments, in the order of the stack (README, section 18).
///
/// Instruments without room between them share a curve. A lone wire, or a stack without room, has
/// one. The state itself is the innermost curve, curve(0); the next ones are curve(1), curve(2), ..
/// The segments of a curve are the material of the instrument on it that reaches farthest.
class WireState : public Curve {
 public:
  using Curve::Curve;
  /// Lays a lone wire, or a stack, along a path (Curve::LayAlong) as one curve, up to the farthest
  /// of `poses`. LayCurves (newton/move_instruments.h) adds the
  /// others.
  static WireState Along(const WireModel& model, const std::vector<Eigen::Vector3d>& path_mm,
                         const InstrumentPoses& poses);

  /// Number of curves, at least 1.
  int curves() const { return 1 + static_cast<int>(others_.size()); }
  /// Curve `c`, in the order of the stack: 0 .. curves() - 1.
  Curve& curve(int c) { return c == 0 ? *this : others_[c - 1]; }
  const Curve& curve(int c) const { return c == 0 ? *this : others_[c - 1]; }
  /// Number of the curve that reaches farthest; of equals, the innermost.
  int FarthestCurve() const {
    int farthest = 0;
    for (int c = 1; c < curves(); ++c) {
      if (curve(c).insertion_mm() > curve(farthest).insertion_mm()) farthest = c;
    }
    return farthest;
  }
  /// The curve that reaches farthest.
  const Curve& Farthest() const { return curve(FarthestCurve()); }
  /// Curve on which an instrument lies.
  const Curve& CurveOf(int instrument) const {
    int c = curves() - 1;
    while (c > 0 && instrument < first_[c - 1]) --c;
    return curve(c);
  }
  /// Removes all curves but the innermost, and reserves room for `count` in all.
  void RemoveOthers(int count) {
    others_.clear();
    others_.reserve(static_cast<std::size_t>(count) - 1);
    first_.clear();
  }
  /// Adds the next curve. `first`: the innermost instrument on it.
  Curve& AddCurve(const WireModel& model, int instruments, int first) {
    first_.push_back(first);
    return others_.emplace_back(model, instruments);
  }

  /// Exchanges all curves with a state whose curves were stepped from the curves of this state.
  void TakeStep(WireState& stepped) {
    Curve::TakeStep(stepped);
    for (std::size_t k = 0; k < others_.size(); ++k) others_[k].TakeStep(stepped.others_[k]);
  }

 private:
  std::vector<Curve> others_;
  std::vector<int> first_;  // instrument of each of `others_`
};

/// FNV-1a, by 64-bit words, over the exact bits of the state.
std::uint64_t HashState(const WireState& state);

}  // namespace torquer
