// Paths for tests: the sources, and the products of this build.
#pragma once

#include <string>

namespace torquer::test {

/// Path of a file in the source tree; `below_root` begins with a slash.
std::string SourcePath(const std::string& below_root);
/// Path of a program of this build.
std::string ProgramPath(const std::string& name);
/// Path of a firmware image of this build.
std::string FirmwarePath(const std::string& name);

}  // namespace torquer::test
