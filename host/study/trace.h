// What the solver does in every iteration of a script: where tuning begins.
#pragma once

#include <memory>

#include "host/study/study.h"

namespace torquer::study {

std::unique_ptr<Study> MakeTraceStudy();

}  // namespace torquer::study
