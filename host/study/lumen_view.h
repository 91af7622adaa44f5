// Lumen view: the lumen of a vessel as seen along the z axis, from the simulated field.
#pragma once

#include <Eigen/Geometry>
#include <vector>

#include "host/simulator/core/clearance_field.h"

namespace torquer::study {

/// Part of one line of the view with lumen at some z.
struct LumenRun {
  double y_mm = 0;  ///< y of the line
  double from_mm = 0;
  double to_mm = 0;  ///< x, from_mm < to_mm
};

/// Projects the lumen within `bounds_mm` along z. There is one line every `step_mm` (> 0), in
/// ascending order. Ends are accurate to a hundredth of `step_mm`. Gaps and parts narrower than
/// `step_mm` may be missed.
std::vector<LumenRun> SeeLumen(const ClearanceField& field, const Eigen::AlignedBox3d& bounds_mm,
                               double step_mm);

}  // namespace torquer::study
