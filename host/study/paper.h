// torquer-study paper: what Baier et al. (2016) measured, measured again.
#pragma once

#include <memory>

#include "host/study/study.h"

namespace torquer::study {

std::unique_ptr<Study> MakePaperStudy();

}  // namespace torquer::study
