// Accuracy study: computing time needed for accuracy, setting by setting.
#pragma once

#include <memory>

#include "host/study/study.h"

namespace torquer::study {

std::unique_ptr<Study> MakeAccuracyStudy();

}  // namespace torquer::study
