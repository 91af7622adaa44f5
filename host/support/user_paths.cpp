#include "host/support/user_paths.h"

#include <fmt/format.h>
#include <unistd.h>

#include <cstdlib>

namespace torquer {

std::string DefaultSocketPath() {
  const char* runtime = std::getenv("XDG_RUNTIME_DIR");
  if (runtime != nullptr && *runtime != '\0') {
    return fmt::format("{}/torquer-emulator.sock", runtime);
  }
  return fmt::format("/tmp/torquer-emulator-{}.sock", getuid());
}

}  // namespace torquer
