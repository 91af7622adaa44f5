// Experiments study: published experiments, simulated and compared with the measurements.
#pragma once

#include <memory>

#include "host/study/study.h"

namespace torquer::study {

std::unique_ptr<Study> MakeExperimentsStudy();

}  // namespace torquer::study
