// Where an installation keeps what belongs to a program or a library.
#pragma once

#include <filesystem>

namespace torquer {

/// What lies `below_prefix` in the installation that the program, or the shared library, that this
/// is linked into belongs to; empty where it is in no installation that has it, as in a build tree.
std::filesystem::path FindInstalled(const std::filesystem::path& below_prefix);

}  // namespace torquer
