// A program under test whose files or clock fail: tests/faults/failing_io.cpp is preloaded into it.
#pragma once

#include <string>
#include <vector>

#include "tests/support/child_process.h"

namespace torquer::test {

/// What fails, and at which step on files below `under`; 0: nothing, but steps are counted.
struct Fault {
  std::string kind;
  int at = 0;
  std::string under;
  std::string log;  ///< file for the steps
};

/// The words that start `words` with the fault; the first of these is a program's path.
std::vector<std::string> WithFault(const Fault& fault, const std::vector<std::string>& words);
/// The same with one setting of failing_io, such as "TORQUER_CLOCK_JUMP_S=86400".
std::vector<std::string> WithSetting(const std::string& setting,
                                     const std::vector<std::string>& words);

/// The steps that were counted: what, and on which file.
std::vector<std::string> Steps(const Fault& fault);

}  // namespace torquer::test
