// Installation paths of the files of a program or a library.
#pragma once

#include <filesystem>

namespace torquer {

/// Path of `below_prefix`, such as share/torquer/devices, in the installation of the program or
/// shared library that this is linked into. The build tree has the same layout. Throws UserError if
/// the path does not exist.
std::filesystem::path FindInstalled(const std::filesystem::path& below_prefix);

}  // namespace torquer
