// The study that tries to break things.
#pragma once

#include <memory>

#include "host/study/study.h"

namespace torquer::study {

std::unique_ptr<Study> MakeTortureStudy();

}  // namespace torquer::study
