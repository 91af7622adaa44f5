// Twist study: distance of a wire rigid in torsion, and of stiffer and softer ones, from a steel
// wire.
#pragma once

#include <memory>

#include "host/study/study.h"

namespace torquer::study {

std::unique_ptr<Study> MakeTwistStudy();

}  // namespace torquer::study
