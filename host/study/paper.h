// Paper study (torquer-study paper): repeats the measurements of Baier et al. (2016).
#pragma once

#include <memory>

#include "host/study/study.h"

namespace torquer::study {

std::unique_ptr<Study> MakePaperStudy();

}  // namespace torquer::study
