// Scaling study: computing time of an equilibrium at sensor rate, and its growth with the number of
// segments.
#pragma once

#include <memory>

#include "host/study/study.h"

namespace torquer::study {

std::unique_ptr<Study> MakeScalingStudy();

}  // namespace torquer::study
