// Study of the estimated segment error, against runs with much shorter segments.
#pragma once

#include <memory>

#include "host/study/study.h"

namespace torquer::study {

std::unique_ptr<Study> MakeSegmentsStudy();

}  // namespace torquer::study
