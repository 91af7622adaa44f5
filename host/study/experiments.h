// Experiments that others have published, done again by the simulator: ours beside theirs.
#pragma once

#include <memory>

#include "host/study/study.h"

namespace torquer::study {

std::unique_ptr<Study> MakeExperimentsStudy();

}  // namespace torquer::study
