#include "host/support/installed.h"

#include <dlfcn.h>

#include <system_error>

namespace torquer {

std::filesystem::path FindInstalled(const std::filesystem::path& below_prefix) {
  Dl_info self = {};
  if (dladdr(reinterpret_cast<const void*>(&FindInstalled), &self) == 0) return {};
  std::error_code none;
  std::filesystem::path folder = std::filesystem::canonical(self.dli_fname, none).parent_path();
  // It is in bin, in lib, or in the machine's folder of lib.
  for (int up = 0; up < 2 && folder.has_relative_path(); ++up) {
    folder = folder.parent_path();
    if (std::filesystem::exists(folder / below_prefix, none)) return folder / below_prefix;
  }
  return {};
}

}  // namespace torquer
