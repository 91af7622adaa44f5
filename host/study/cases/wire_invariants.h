// Wire invariants: conditions that hold for every wire after every action.
#pragma once

#include <Eigen/Core>
#include <string>

#include "host/simulator/core/clearance_field.h"
#include "host/simulator/core/relaxation.h"
#include "host/simulator/core/wire_model.h"
#include "host/simulator/core/wire_state.h"

namespace torquer::study {

/// Violated invariants of a state, in words; empty if there are none. Checked are finite values,
/// unit tangents, perpendicular unit normals, lengths to 1e-9, and arc length equal to the
/// insertion.
std::string BrokenGeometry(const WireModel& model, const Curve& state);

/// Checker of a tick: compares the report with the state, and checks the tip's motion.
class TickChecker {
 public:
  TickChecker(const WireModel& model, const ClearanceField& field, const WireState& before);

  /// Checks after a tick towards `target`; returns the errors, empty if there are none.
  /// `points_per_segment` as in the WallModel of the relaxation.
  std::string Check(const InstrumentPoses& target, const TickReport& report, const WireState& state,
                    int points_per_segment);

  double DeepestPenetration(const WireState& state, int points_per_segment) const;

 private:
  void Remember(const WireState& state);

  const WireModel& model_;
  const ClearanceField& field_;
  const double bend_mm_;  ///< distance of a free tip from the line of the straight part
  Eigen::Vector3d tip_;
  double insertion_mm_ = 0;
  double rotation_rad_ = 0;
};

}  // namespace torquer::study
