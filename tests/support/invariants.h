// Invariants of host/study for every wire, under names for tests.
#pragma once

#include "host/study/cases/wire_invariants.h"

namespace torquer::test {

using study::BrokenGeometry;
using study::TickChecker;

}  // namespace torquer::test
