// The points at which the wire may touch the wall, and the field look-ups that they take.
#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <vector>

#include "host/simulator/core/clearance_field.h"
#include "host/simulator/core/energy_term.h"
#include "host/simulator/core/stack/instrument_stack.h"
#include "host/simulator/core/wire_model.h"
#include "host/simulator/core/wire_state.h"

namespace torquer {

/// Points closer to touching than this are `near`: the next step may make them touch.
inline constexpr double kNearMm = 0.05;

/// Where the wall is stiffer or softer.
class WallStiffness {
 public:
  virtual ~WallStiffness() = default;
  /// k at a place of the vessel, N/mm^2, > 0.
  virtual double At(const Eigen::Vector3d& point_mm) const = 0;
};

/// The wall as a spring: U = 1/2 k (length of wire) penetration^2 for every contact point.
struct WallModel {
  double stiffness_N_mm2 = 1;  ///< k, per length of wire; 1e-6 .. 1e3
  int points_per_segment = 2;  ///< contact points; 1 .. 8. One, as in the paper, makes sliding
                               ///< rugged with the period of the segments.
  /// Instead of stiffness_N_mm2, where it is not the same everywhere. Taken over by every contact
  /// point when the wire is moved, and constant until it is moved again.
  const WallStiffness* by_place = nullptr;
};

/// Places the contact points of states of one wire. Remembers the last look-up of each material
/// point: until it has moved by its clearance over the field's Lipschitz bound it cannot touch and
/// is not looked up. Nothing changes by that, to the bit.
class ContactPoints {
 public:
  /// Keeps references to all. `stack`: of instruments on two curves, the outer of which touch the
  /// wall where both are; null where there is one curve.
  ContactPoints(const WireModel& model, const ClearanceField& field, const WallModel& wall,
                const InstrumentStack* stack);

  /// Places the points of a state and finds which are near the wall and which touch it; Hessians of
  /// the near ones only where asked for.
  void Place(const WireState& state, bool with_hessian, PointSet& points);
  /// Takes over the wall's stiffness at every point. To be called after a move; where the vessel
  /// has moved since, Place does it by itself.
  void TakeStiffness(const WireState& state);
  /// Takes over the radii of the model where they have grown. To be called after they changed, as
  /// those of a rod of several instruments do.
  void TakeRadii();
  /// Forgets what look-ups of former states allow to skip. Needed when the state was replaced
  /// rather than moved.
  void Forget();
  /// Skips what `twin`, the same points on the same vessel, would skip.
  void CopyFrom(const ContactPoints& twin);
  /// Makes room in `points` for the longest wire.
  void Reserve(PointSet& points) const;
  /// The most points that a wire has.
  std::size_t capacity() const { return last_.size(); }
  /// Look-ups since construction.
  std::int64_t lookups() const { return lookups_done_; }

 private:
  // Within `free_mm` of `at`, less what the vessel has moved by, the point cannot touch.
  struct Lookup {
    Eigen::Vector3d at;
    double free_mm;
  };

  const WireState& CurveAt(const WireState& state, int q) const;
  void PlaceCovered(const WireState& state, PointSet& points) const;

  const WireModel& model_;
  const InstrumentStack* stack_;
  const ClearanceField& field_;
  const WallModel& wall_;
  double lipschitz_;
  std::vector<Lookup> last_;       // by PointSet::FromTip
  std::vector<double> radius_mm_;  // by segment from the tip; of the look-ups
  std::vector<double>
      stiffness_N_mm2_;             // by PointSet::FromTip; empty where it is the same everywhere
  double stiffness_travel_mm_ = 0;  // of the field, when they were taken
  std::int64_t lookups_done_ = 0;
};

}  // namespace torquer
