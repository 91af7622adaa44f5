// Contact points: the points of the wire that may touch the wall, and their field look-ups.
#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <vector>

#include "host/simulator/core/clearance_field.h"
#include "host/simulator/core/curve.h"
#include "host/simulator/core/point_set.h"
#include "host/simulator/core/stack/instrument_stack.h"
#include "host/simulator/core/wire_model.h"

namespace torquer {

/// Points closer to touching than this are `near`: the next step may make them touch.
inline constexpr double kNearMm = 0.05;

/// Wall stiffness as a function of place.
class WallStiffness {
 public:
  virtual ~WallStiffness() = default;
  /// k at a point of the vessel, N/mm^2, > 0.
  virtual double At(const Eigen::Vector3d& point_mm) const = 0;
};

/// The wall as a spring: U = 1/2 k (length of wire) penetration^2 for every contact point.
struct WallModel {
  double stiffness_N_mm2 = 1;  ///< k, per length of wire; 1e-6 .. 1e3
  int points_per_segment = 2;  ///< contact points; 1 .. 8. With one, as in the paper, sliding is
                               ///< rough with the period of the segments.
  /// Replaces stiffness_N_mm2 if the stiffness varies with place; otherwise null. Every contact
  /// point samples it when the wire is moved, and keeps the sample until the next move.
  const WallStiffness* stiffness_field = nullptr;
};

/// Places the contact points of one curve. Remembers the last look-up of each material
/// point. A point cannot touch until it has moved by its clearance over the field's Lipschitz
/// bound. Until then its look-up is skipped, which leaves the results bit-identical.
class ContactPoints {
 public:
  /// Keeps references to all. `stack`: the stack of several instruments that contains `curve`; null
  /// for a lone curve with all instruments of its states.
  ContactPoints(const WireModel& model, const ClearanceField& field, const WallModel& wall,
                const InstrumentStack* stack, int curve);

  /// Places the points of a state and finds those near the wall and those that touch it. The first
  /// `in_lumen_mm` are away from the wall. Computes Hessians of the near points only if
  /// `with_hessian`.
  void Place(const Curve& curve, double in_lumen_mm, bool with_hessian, PointSet& points);
  /// Samples the wall's stiffness at every point. Call it after each move of the wire. Place does
  /// so itself after a move of the vessel.
  void SampleStiffness(const Curve& curve);
  /// Forgets the stored look-ups. Call it after the state was replaced rather than moved.
  void Forget();
  /// Takes over the stored look-ups of `twin`, which has the same points on the same vessel.
  void CopyFrom(const ContactPoints& twin);
  /// Reserves room in `points` for the longest wire.
  void Reserve(PointSet& points) const;
  /// Largest number of points of a wire.
  std::size_t capacity() const { return last_.size(); }
  /// Number of look-ups since construction.
  std::int64_t lookups() const { return lookups_done_; }

 private:
  // A point without radius cannot come near within `free_mm` of `at`, less the travel of the
  // vessel.
  struct Lookup {
    Eigen::Vector3d at;
    double free_mm;
  };

  void PlaceInstruments(const Curve& curve, double in_lumen_mm, PointSet& points) const;
  bool HasTip(int segment, const PointSet& points) const;
  double PartRadius(int q, PointSet& points) const;
  void TakeParts(double clearance_mm, int q, PointSet& points) const;

  const WireModel& model_;
  const InstrumentStack* stack_;
  int number_;  // of the curve
  const ClearanceField& field_;
  const WallModel& wall_;
  double lipschitz_;
  std::vector<Lookup> last_;             // by PointSet::FromTip
  std::vector<double> stiffness_N_mm2_;  // by PointSet::FromTip; empty for uniform stiffness
  double stiffness_travel_mm_ = 0;       // travel of the field when the stiffness was sampled
  std::int64_t lookups_done_ = 0;
};

}  // namespace torquer
