// Trace study: solver data of every iteration of a script, for tuning.
#pragma once

#include <memory>

#include "host/study/study.h"

namespace torquer::study {

std::unique_ptr<Study> MakeTraceStudy();

}  // namespace torquer::study
