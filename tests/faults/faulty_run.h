// Runs a program whose files or clock fail, with tests/faults/failing_io.cpp preloaded.
#pragma once

#include <string>
#include <vector>

#include "tests/support/child_process.h"

namespace torquer::test {

/// Kind of failure, and the number of the failing step on files below `under`; 0 only counts steps.
struct Fault {
  std::string kind;
  int at = 0;
  std::string under;
  std::string log;  ///< file that lists the steps
};

/// Command that runs `words` with the fault; the first of `words` is a program's path.
std::vector<std::string> WithFault(const Fault& fault, const std::vector<std::string>& words);
/// Command with one setting of failing_io, such as "TORQUER_CLOCK_JUMP_S=86400".
std::vector<std::string> WithSetting(const std::string& setting,
                                     const std::vector<std::string>& words);

/// Counted steps: function and file of each.
std::vector<std::string> Steps(const Fault& fault);

}  // namespace torquer::test
