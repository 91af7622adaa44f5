// What host/study holds every wire to, under the names that tests use.
#pragma once

#include "host/study/cases/wire_invariants.h"

namespace torquer::test {

using study::BrokenGeometry;
using study::TickChecker;

}  // namespace torquer::test
