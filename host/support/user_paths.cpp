#include "host/support/user_paths.h"

#include <fmt/format.h>
#include <unistd.h>

#include <cctype>
#include <cstdlib>

namespace torquer {

std::string DefaultSocketPath() {
  const char* runtime = std::getenv("XDG_RUNTIME_DIR");
  if (runtime != nullptr && *runtime != '\0') {
    return fmt::format("{}/torquer-emulator.sock", runtime);
  }
  return fmt::format("/tmp/torquer-emulator-{}.sock", getuid());
}

std::optional<std::string> DeviceFilePath(const std::string& serial, const std::string& ending) {
  const char* config = std::getenv("XDG_CONFIG_HOME");
  const char* home = std::getenv("HOME");
  std::string folder;
  if (config != nullptr && config[0] == '/') {
    folder = config;
  } else if (home != nullptr && home[0] == '/') {
    folder = std::string(home) + "/.config";
  } else {
    return std::nullopt;
  }
  // A slash or a name of dots alone would lead out of the folder.
  std::string name;
  for (const char character : serial) {
    const bool plain = std::isalnum(static_cast<unsigned char>(character)) != 0 ||
                       character == '-' || character == '_' || (character == '.' && !name.empty());
    name += plain ? character : '_';
  }
  return folder + "/torquer/" + (name.empty() ? "_" : name) + ending;
}

}  // namespace torquer
