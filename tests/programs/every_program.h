// Programs of the build, listed from their folder, so that the tests include each new one.
#pragma once

#include <sys/stat.h>

#include <algorithm>
#include <filesystem>
#include <string>
#include <vector>

#include "tests/support/paths.h"

namespace torquer::test {

/// Words of a command line.
using Words = std::vector<std::string>;

/// Names of all programs except the tests.
inline std::vector<std::string> Programs() {
  std::vector<std::string> programs;
  for (const auto& entry : std::filesystem::directory_iterator(ProgramPath(""))) {
    struct stat status {};
    const std::string name = entry.path().filename();
    const bool runs = stat(entry.path().c_str(), &status) == 0 && S_ISREG(status.st_mode) &&
                      (status.st_mode & S_IXUSR) != 0;
    if (runs && !name.ends_with("_test")) programs.push_back(name);
  }
  std::sort(programs.begin(), programs.end());
  return programs;
}

}  // namespace torquer::test
