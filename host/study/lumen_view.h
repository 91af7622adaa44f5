// The lumen of a vessel as seen along an axis, from the field that is simulated.
#pragma once

#include <Eigen/Geometry>
#include <vector>

#include "host/simulator/core/clearance_field.h"

namespace torquer::study {

/// A stretch of one line of the view that is within the lumen, somewhere along z.
struct LumenRun {
  double y_mm = 0;  ///< of the line
  double from_mm = 0;
  double to_mm = 0;  ///< x, from_mm < to_mm
};

/// What one who looks along z sees of the lumen within `bounds_mm`: a line every `step_mm` (> 0),
/// in ascending order. Ends are true to a hundredth of that; gaps and parts narrower than it may be
/// missed.
std::vector<LumenRun> SeeLumen(const ClearanceField& field, const Eigen::AlignedBox3d& bounds_mm,
                               double step_mm);

}  // namespace torquer::study
