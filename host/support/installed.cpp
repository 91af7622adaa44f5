#include "host/support/installed.h"

#include <dlfcn.h>
#include <link.h>

#include <system_error>

#include "host/support/error.h"

namespace torquer {
namespace {

// File of the program or of the shared library that contains this code.
std::filesystem::path OwnFile() {
  Dl_info self = {};
  link_map* loaded = nullptr;
  const bool found = dladdr1(reinterpret_cast<const void*>(&FindInstalled), &self,
                             reinterpret_cast<void**>(&loaded), RTLD_DL_LINKMAP) != 0;
  // For a program, dladdr only knows argv[0], which has no folder if a shell found it by PATH.
  const bool library = found && loaded->l_name[0] != '\0';
  std::error_code none;
  return std::filesystem::canonical(library ? loaded->l_name : "/proc/self/exe", none);
}

}  // namespace

std::filesystem::path FindInstalled(const std::filesystem::path& below_prefix) {
  const std::filesystem::path file = OwnFile();
  std::filesystem::path folder = file;
  // The file is in bin, in bin/helpers, in lib, or in the machine's folder of lib. The module of a
  // wheel is in the prefix itself.
  for (int up = 0; up < 3 && folder.has_relative_path(); ++up) {
    folder = folder.parent_path();
    std::error_code missing;
    std::filesystem::path found = std::filesystem::canonical(folder / below_prefix, missing);
    if (!missing) return found;
  }
  throw UserError(file.string() + ": its " + below_prefix.string() +
                  " is missing; install or build Torquer again");
}

}  // namespace torquer
