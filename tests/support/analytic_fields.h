// Small vessels of host/study, under names for tests.
#pragma once

#include "host/study/cases/analytic_fields.h"

namespace torquer::test {

using study::AnalyticField;
using study::Capsule;
using study::Cylinder;
using study::FreeSpace;
using study::HalfSpace;
using study::RoundWall;
using study::Side;
using study::Torus;

}  // namespace torquer::test
