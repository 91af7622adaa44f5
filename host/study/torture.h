// Torture study: randomly drawn hard cases that try to break the relaxation.
#pragma once

#include <memory>

#include "host/study/study.h"

namespace torquer::study {

std::unique_ptr<Study> MakeTortureStudy();

}  // namespace torquer::study
