// How far a wire that does not twist, and stiffer and softer ones, lie from a wire of steel.
#pragma once

#include <memory>

#include "host/study/study.h"

namespace torquer::study {

std::unique_ptr<Study> MakeTwistStudy();

}  // namespace torquer::study
