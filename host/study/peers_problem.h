// The problem on which peers.md compares simulators: a wire in a quarter of a torus.
#pragma once

#include "host/study/study.h"

namespace torquer::study {

/// Measures three motions with n = 100 and 250, and adds a section with their times.
///
/// The wire: 250 mm, EI 6.35e-9 N m^2, radius 0.178 mm. The lumen: radius 3 mm, bent with a radius
/// of 160 mm, wall 1 N/mm^2, friction 0.1. A row is a feed of 0.5 mm, relaxed to a residual of
/// 1e-6. Motions: from 0 to 250 mm, the last 50 mm, and ten times 12.5 mm back and in again.
void MeasurePeersProblem(StudyRun& run);

}  // namespace torquer::study
