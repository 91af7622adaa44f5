// Scenes and hands that try to break a relaxation, and what has to hold meanwhile.
//
// The table serves the stability tests and longer runs alike: a case draws what is left open from
// a seed, so that other seeds make other cases.
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
  std::vector<InstrumentPlaces> script;  ///< one a tick
  int units = 40;                        ///< budget of a tick
  int settle_ticks = 40;  ///< of 400 units each, with the hand still after the script
  double start_mm = 0;    ///< laid along start_path before the script
  std::vector<Eigen::Vector3d> start_path = {};
  std::vector<Eigen::Vector3d> start_tangents = {};  ///< or with these tangents
  /// How far a shaped tip stands off the straight wire, where the case's bound on the depth is one
  /// for straight wires: a stiff tip in a soft wall lies so much deeper.
  double tip_stands_off_mm = 0;
};

/// What the paper's method does with a case. Its cycles move the wire by less and less: within the
/// work of a script it is near its balance and hardly ever at rest, so that its depth is bounded in
/// all ticks and not only in those that converged. Where it differs from this, the table says why.
struct PaperExpectation {
  /// Deepest penetration in any tick. None: that of an unbent wire.
  std::optional<double> deepest_mm = 0.2;
  bool settles = false;    ///< it comes to rest after the script all the same
  bool or_unbent = false;  ///< as deep as an unbent wire, where that is deeper
};

struct HardCase {
  std::string name;
  std::function<HardScene(std::mt19937& random)> make;
  /// Deepest penetration where a tick of Newton's converged: twice to five times what was measured.
  /// None: HardOutcome::unbent_mm, which no balance of forces passes.
  std::optional<double> deepest_mm = {};
  bool for_paper = true;  ///< the paper's method takes n^2 to n^3 time
  bool settles = true;    ///< Newton's wire comes to rest after the script
  PaperExpectation paper = {};
};

enum class Extent {
  kTests,  ///< a few minutes for all
  kSoak,   ///< a million actions in turn, and n from 1 to 10,000
};

/// All cases; the last is "anything at random".
std::vector<HardCase> HardCases(Extent extent = Extent::kTests);

struct HardOutcome {
  std::string broken;  ///< what did not hold, at which tick; empty when all did
  int ticks = 0;
  int converged = 0;
  int snaps = 0;
  double deepest_mm = 0;  ///< of all ticks
  double at_rest_mm = 0;  ///< deepest of the converged ones
  /// Of a straight wire, as long as the script ever asks for, from the sheath on; at least how deep
  /// the wire lies at the start.
  double unbent_mm = 0;
  double tip_stands_off_mm = 0;  ///< HardScene's
  bool settled = false;          ///< with the hand still, in the end
  double last_residual = 0;
  int longest_work = 0;
  double worst_rise = 0;  ///< of the energy over one of Newton's steps, as a part of the energy
};

/// Runs a case: the script, then the hand rests, then all is drawn out and begins again. After
/// every tick it checks geometry, report and the tip's way (TickChecker); where Newton's wire came
/// to rest without friction, that its penetrations are what balances the bending (UnbalancedBend);
/// while the hand rests, that no step of Newton's raises the energy. `watch`, if given, gets
/// every tick.
HardOutcome RunHardCase(const HardCase& hard, Way way, unsigned seed,
                        const std::function<void(int ticks)>& watch = nullptr);

/// What of an outcome is beyond what its case allows, in words: `broken`, depth, or a wire that
/// does not come to rest; empty when nothing is.
std::string Objection(const HardCase& hard, Way way, const HardOutcome& outcome);

/// The largest moment, over the local EI/(1 mm), that bending and the wall's pressure leave
/// unbalanced on a segment without rest bends: from positions, clearances and the bending law
/// alone, apart from the expansions that the methods use.
double UnbalancedBend(const WireModel& model, const ClearanceField& field, const WallModel& wall,
                      const WireState& state);

}  // namespace torquer::study
