// The paper's workflow (Baier et al. 2016, section 3.3 and Fig. 10). Every action is followed by a
// Tip Relaxation at once. Without action, slices of Physical Relaxation run until its cycle ends,
// then slices of Geometrical Relaxation, then again. An action interrupts either.
#pragma once

#include <optional>
#include <vector>

#include "host/simulator/core/paper/geometrical_relaxation.h"
#include "host/simulator/core/paper/physical_relaxation.h"
#include "host/simulator/core/relaxation.h"

namespace torquer {

/// Relaxation cycles while there is no action.
enum class PaperCycles {
  kNone,         ///< none: Tip Relaxations only, as in the paper's fast insertion
  kPhysical,     ///< PR cycles alone
  kGeometrical,  ///< PR and GR cycles in turn: the paper's workflow
};

struct PaperSettings {
  PhysicalSettings physical;
  GeometricalSettings geometrical;
  PaperCycles cycles = PaperCycles::kGeometrical;
  double max_turn_rad = 0.2;  ///< largest rotation that one action carries out
  double tolerance = 1e-3;    ///< residual at which a tick counts as converged
};

/// Inserts a segment just before the tip, parallel to the one before it (paper, Fig. 1). While only
/// the tip is inside, it is inserted at the sheath. Returns false at model.max_length_mm().
bool InsertSegment(const WireModel& model, WireState& state);
/// Inverse of InsertSegment: removes the segment just before the tip. Returns false if no segment
/// is left.
bool RetractSegment(const WireModel& model, WireState& state);

/// The paper's method for a lone wire. It moves whole segments only and carries the remainder. One
/// unit of work is an action with its Tip Relaxation, or a slice. A slice is m(m+1)/2 updates of a
/// PR cycle, or m(m+1)/(nu-mu) sweeps of a GR cycle. A tick ends at the latest after the GR cycle
/// that follows a PR cycle. If settings.cycles has no GR cycle, it ends after the PR cycle. Cycles
/// that the budget interrupts continue in the next tick.
class PaperRelaxation final : public Relaxation {
 public:
  /// `wall.points_per_segment` must be 1: in the paper only nodes make contact.
  PaperRelaxation(const WireModel& model, const ClearanceField& field, const WallModel& wall,
                  const PaperSettings& settings);

  void Restart(WireState& state) override;
  void CopyFrom(const Relaxation& twin, const WireState& state) override;
  const QuadraticModel& Current() const override { return current_; }

  const PhysicalRelaxation& physical() const { return physical_; }
  const GeometricalRelaxation& geometrical() const { return geometrical_; }

 private:
  enum class Action { kNone, kInsert, kRetract, kRotate };

  bool Arrived(const InstrumentPoses& goal, const WireState& state) const override;
  void Begin(WireState& state) override;
  // Fig. 10: an action always comes first.
  bool MayMove() const override { return true; }
  int Move(const InstrumentPoses& goal, WireState& state) override;
  bool AtRest(WireState& state) override;
  void Relax(WireState& state, TickReport& report) override;
  void End(const WireState& state, bool settled, TickReport& report) override;

  Action NextAction(const InstrumentPoses& goal, const WireState& state) const;
  bool RelaxSlice(WireState& state);
  void InterruptCycles(WireState& state);
  void BringUpToDate(const WireState& state);

  const WireModel& model_;
  const PaperSettings settings_;
  const std::vector<EnergyTerm*> no_terms_;
  WireMechanics mechanics_;
  PhysicalRelaxation physical_;
  GeometricalRelaxation geometrical_;
  bool physical_done_ = false;  // the PR cycle has ended, but not its GR cycle
  std::optional<bool>
      ended_;               // true if the cycles of this tick have ended; empty until first asked
  bool up_to_date_ = true;  // current_ belongs to the state
  std::int64_t updates_before_ = 0;
  QuadraticModel current_;
};

}  // namespace torquer
