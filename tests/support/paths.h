// Where tests find what they use: the sources, and what this build made of them.
#pragma once

#include <string>

namespace torquer::test {

/// A file of the source tree; `below_root` begins with a slash.
std::string SourcePath(const std::string& below_root);
/// A program of this build.
std::string ProgramPath(const std::string& name);
/// A firmware image of this build.
std::string FirmwarePath(const std::string& name);

}  // namespace torquer::test
