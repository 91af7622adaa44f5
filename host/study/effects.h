// Effects study: computing time of every effect.
#pragma once

#include <memory>

#include "host/study/study.h"

namespace torquer::study {

/// `torquer-study effects`: cost of a tick of the T-Y phantom's wire, n = 250. It measures no
/// effect, each effect alone, each pair from a shipped scene, and all effects.
std::unique_ptr<Study> MakeEffectsStudy();

}  // namespace torquer::study
