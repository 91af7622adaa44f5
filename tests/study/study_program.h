// Path of the program under test.
#pragma once

#include <string>

#include "tests/support/paths.h"

namespace torquer::test {

inline const std::string kStudyProgram = ProgramPath("torquer-study");

}  // namespace torquer::test
