#include "tests/support/private_network.h"

#include <unistd.h>

#include <cstdlib>
#include <fstream>
#include <iterator>
#include <stdexcept>
#include <string>
#include <vector>

#include "tests/support/paths.h"

namespace torquer::test {

namespace {

void Restart(bool with_devices) {
  constexpr char kMarker[] = "TORQUER_TEST_NETWORK";
  // The marker is valid only for the process that set it: exec keeps the process id.
  const std::string self = std::to_string(getpid());
  if (const char* owner = std::getenv(kMarker); owner != nullptr && owner == self) return;
  setenv(kMarker, self.c_str(), 1);
  std::ifstream file("/proc/self/cmdline", std::ios::binary);
  std::string words((std::istreambuf_iterator<char>(file)), std::istreambuf_iterator<char>());
  std::string script = SourcePath("/host/bus/private_network");
  std::string env = "/usr/bin/env";
  std::string preload = "LD_PRELOAD=libumockdev-preload.so.0";
#if defined(__SANITIZE_ADDRESS__)
  preload = "LD_PRELOAD=libasan.so.8:libumockdev-preload.so.0";  // ASan must come first
#endif
  std::string program(4096, '\0');
  const ssize_t length = readlink("/proc/self/exe", program.data(), program.size());
  program.resize(length > 0 ? static_cast<std::size_t>(length) : 0);

  std::vector<char*> arguments{script.data()};
  // Only the program gets the library, not the tools that create the network.
  if (with_devices) arguments.insert(arguments.end(), {env.data(), preload.data()});
  arguments.push_back(program.data());
  const std::size_t own_name = words.find('\0') + 1;
  for (std::size_t start = own_name; start < words.size(); start = words.find('\0', start) + 1) {
    arguments.push_back(words.data() + start);
  }
  arguments.push_back(nullptr);
  execv(script.c_str(), arguments.data());
  throw std::runtime_error("cannot run " + script);
}

}  // namespace

void NeedPrivateNetwork() { Restart(false); }
void NeedPrivateNetworkAndDevices() { Restart(true); }

}  // namespace torquer::test
