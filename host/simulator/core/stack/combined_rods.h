// Combined rods: the instruments of each curve of a stack, added up to one rod at their poses.
//
//   sheath |==========================------------------........   outermost: a guiding catheter,
//          |                                                       in it a microcatheter, in it
//          |  all three: EI adds up      two              one      the guidewire
//
// At a place with several instruments, rigidities add up, and the rod rests at
//   kappa = sum(EI_k kappa_k) / sum(EI_k)                                        (README (30)).
// Every rest curvature turns with its instrument: with the hand or, with twist, with the local turn
// (core/README.md section 17). An instrument that slides in the others changes the rod's
// properties, not its position. A tip divides the joints around it into parts with and parts
// without the instrument. A lone wire is its own rod.
#pragma once

#include <Eigen/Core>
#include <array>
#include <cstddef>
#include <vector>

#include "host/simulator/core/curve.h"
#include "host/simulator/core/instrument_pose.h"
#include "host/simulator/core/stack/instrument_stack.h"
#include "host/simulator/core/wire_model.h"

namespace torquer {

class CombinedRods {
 public:
  /// Rods of instruments that are not inserted. The stack must outlive this.
  explicit CombinedRods(const InstrumentStack& stack);
  CombinedRods(const CombinedRods&) = delete;
  CombinedRods& operator=(const CombinedRods&) = delete;

  const InstrumentStack& stack() const { return stack_; }
  /// Rod of a curve at the poses of the last Combine. The reference stays valid.
  const WireModel& operator[](int curve) const {
    return combined_.empty() ? stack_.instrument(0) : combined_[curve];
  }
  /// Sets the rods to the instruments at `poses`. A rod is defined up to a segment past its reach;
  /// farther joints have any properties. O(segments), no heap; no effect for a lone wire.
  void Combine(const InstrumentPoses& poses);
  /// Energy of the instruments of a curve that bend each other, at those poses, mJ. It acts on no
  /// shape, so the rod does not have it. 0 if they twist: then their spins have it.
  double MutualEnergyMJ(int number, const Curve& curve) const;

 private:
  // An instrument in a rod, and the distance of its tip behind the rod's end.
  struct Member {
    const WireModel* model = nullptr;
    std::size_t instrument = 0;
    double behind_mm = 0;
    double near_mm = 0;  // length past the sheath, at most two segments
    Eigen::Vector2d turn = {1, 0};

    bool operator==(const Member&) const = default;
  };
  // The instruments of a rod, and the number of joints that it has.
  struct Members {
    std::array<Member, kMostInstruments> of;
    int count = 0;
    std::size_t joints = 0;

    bool operator==(const Members&) const = default;
  };

  Members Gather(const InstrumentPoses& poses, int curve) const;
  void CombineRod(const Members& members, int first, WireModel& rod);
  static double MutualOf(const Members& members, const JointIntegrals& integrals);
  static void CombineTwists(const Members& members, const JointIntegrals& integrals,
                            double from_tip_mm, WireModel::TwistingJoint& joint);

  const InstrumentStack& stack_;
  std::vector<WireModel> combined_;  // by curve; empty for a lone wire
  std::vector<Members> members_;     // by curve: of its rod
  std::size_t most_joints_ = 0;
  // Work space.
  std::vector<WireModel::Joint> joints_;
  std::vector<WireModel::TwistingJoint> twisting_;  // empty without twist
};

}  // namespace torquer
