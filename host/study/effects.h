// What every effect costs.
#pragma once

#include <memory>

#include "host/study/study.h"

namespace torquer::study {

/// `torquer-study effects`: a tick of the T-Y phantom's wire, n = 250, without any effect, with
/// each alone, with each pair that a shipped scene names, and with all.
std::unique_ptr<Study> MakeEffectsStudy();

}  // namespace torquer::study
