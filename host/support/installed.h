// Where an installation keeps what belongs to a program or a library.
#pragma once

#include <filesystem>

namespace torquer {

/// What lies `below_prefix`, such as share/torquer/devices, in the installation that the program,
/// or the shared library, that this is linked into belongs to. The build tree is laid out as one.
/// Throws UserError where it is not there.
std::filesystem::path FindInstalled(const std::filesystem::path& below_prefix);

}  // namespace torquer
