// Hard cases: scenes and hand motions that try to break a relaxation, and the conditions that must
// hold.
//
// The table serves the stability tests and longer runs. A case draws its random parameters from a
// seed, so other seeds give other cases.
#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <functional>
#include <memory>
#include <optional>
#include <random>
#include <string>
#include <vector>

#include "host/simulator/core/clearance_field.h"
#include "host/simulator/core/relaxation.h"
#include "host/simulator/core/wire_mechanics.h"
#include "host/simulator/core/wire_model.h"
#include "host/simulator/core/wire_state.h"

namespace torquer::study {

enum class Way { kNewton, kNewtonWithFriction, kPaper };

inline constexpr Way kAllWays[] = {Way::kNewton, Way::kNewtonWithFriction, Way::kPaper};

const char* NameOf(Way way);

struct HardScene {
  std::shared_ptr<const ClearanceField> field;
  WireModel model;
  WallModel wall;
  std::vector<InstrumentPoses> script;  ///< one target per tick
  int units = 40;                       ///< work budget of a tick
  int settle_ticks = 40;                ///< of 400 units each, with the hand still after the script
  double start_mm = 0;                  ///< length laid along start_path before the script
  std::vector<Eigen::Vector3d> start_path = {};
  std::vector<Eigen::Vector3d> start_tangents = {};  ///< optional tangents of the start
  /// Offset of a shaped tip from the straight wire, for cases with a depth bound for straight
  /// wires. A stiff tip in a soft wall lies deeper by this offset.
  double tip_stands_off_mm = 0;
};

/// Expected behavior of the paper's method in a case. Its cycles move the wire by less and less.
/// Within the work of a script it gets near its equilibrium but rarely converges. Its depth is
/// therefore bounded in all ticks, not only in the converged ones. The table gives the reasons for
/// exceptions.
struct PaperExpectation {
  /// Deepest penetration allowed in any tick. No value: the depth of an unbent wire.
  std::optional<double> deepest_mm = 0.2;
  bool settles = false;    ///< it converges after the script nevertheless
  bool or_unbent = false;  ///< may be as deep as an unbent wire, if that is deeper
};

struct HardCase {
  std::string name;
  std::function<HardScene(std::mt19937& random)> make;
  /// Deepest penetration allowed in a converged tick of Newton's method: two to five times the
  /// measured one. No value: HardOutcome::unbent_mm, which no equilibrium exceeds.
  std::optional<double> deepest_mm = {};
  bool for_paper = true;  ///< the paper's method takes n^2 to n^3 time
  bool settles = true;    ///< Newton's method converges after the script
  PaperExpectation paper = {};
};

enum class Extent {
  kTests,  ///< a few minutes for all
  kSoak,   ///< a million actions in turn, and n from 1 to 10,000
};

/// All cases; the last is "anything at random".
std::vector<HardCase> HardCases(Extent extent = Extent::kTests);

struct HardOutcome {
  std::string broken;  ///< violated condition and its tick; empty if none
  int ticks = 0;
  int converged = 0;
  int snaps = 0;
  double deepest_mm = 0;  ///< deepest penetration in all ticks
  double at_rest_mm = 0;  ///< deepest penetration in the converged ticks
  /// Depth of a straight wire from the sheath, of the largest length in the script. Not less than
  /// the wire's depth at the start.
  double unbent_mm = 0;
  double tip_stands_off_mm = 0;  ///< HardScene's
  bool settled = false;          ///< converged at the end with the hand still
  double last_residual = 0;
  int longest_work = 0;
  double worst_rise = 0;  ///< relative rise of the energy over one step of Newton's method
};

/// Runs a case: the script, then a resting hand, then full retraction and a restart. After every
/// tick it checks geometry, report and the tip's motion (TickChecker). If Newton's method converged
/// without friction, it checks that the wall forces balance the bending (UnbalancedBend). While the
/// hand rests, it checks that no step of Newton's method raises the energy. `watch`, if given, is
/// called after every tick.
HardOutcome RunHardCase(const HardCase& hard, Way way, unsigned seed,
                        const std::function<void(int ticks)>& watch = nullptr);

/// Violations of the case's limits by an outcome, in words: `broken`, depth, or no convergence;
/// empty if there are none.
std::string Objection(const HardCase& hard, Way way, const HardOutcome& outcome);

/// Largest unbalanced moment of bending and wall forces on a segment without rest bends, divided by
/// the local EI/(1 mm). It is computed from positions, clearances and the bending law alone,
/// independent of the models that the methods use.
double UnbalancedBend(const WireModel& model, const ClearanceField& field, const WallModel& wall,
                      const WireState& state);

}  // namespace torquer::study
