// What an equilibrium costs at sensor rate, and how that grows with the number of segments.
#pragma once

#include <memory>

#include "host/study/study.h"

namespace torquer::study {

std::unique_ptr<Study> MakeScalingStudy();

}  // namespace torquer::study
