#include "tests/fuzz/target.h"

#include <sys/mman.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <cstdio>
#include <cstdlib>
#include <exception>
#include <fstream>
#include <iterator>
#include <stdexcept>

#include "host/support/error.h"
#include "tests/support/paths.h"

namespace torquer::fuzz {
namespace {

std::vector<Target>& Targets() {
  static std::vector<Target> targets;
  return targets;
}

}  // namespace

Registration::Registration(Target target) { Targets().push_back(std::move(target)); }

const Target& FindTarget(const std::string& name) {
  for (const Target& target : Targets()) {
    if (target.name == name) return target;
  }
  std::fprintf(stderr, "no target '%s'; there are:", name.c_str());
  for (const Target& target : Targets()) std::fprintf(stderr, " %s", target.name.c_str());
  std::fprintf(stderr, "\n");
  std::exit(2);
}

std::vector<std::string> TargetNames() {
  std::vector<std::string> names;
  for (const Target& target : Targets()) names.push_back(target.name);
  std::sort(names.begin(), names.end());
  return names;
}

bool Try(const Target& target, std::span<const std::uint8_t> input) {
  try {
    return target.accepts(input);
  } catch (const UserError&) {
    return false;
  } catch (const std::exception& e) {
    std::fprintf(stderr, "%s: an exception that is not a refusal: %s\n", target.name.c_str(),
                 e.what());
    std::abort();
  }
}

std::string FileWith(std::span<const std::uint8_t> bytes) {
  static const int file = [] {
    const int made = memfd_create("torquer-fuzz", MFD_CLOEXEC);
    if (made < 0 || fchmod(made, 0600) != 0) throw std::logic_error("no file in memory");
    return made;
  }();
  if (ftruncate(file, 0) != 0 ||
      pwrite(file, bytes.data(), bytes.size(), 0) != static_cast<ssize_t>(bytes.size())) {
    throw std::logic_error("a file in memory cannot be written");
  }
  return "/proc/self/fd/" + std::to_string(file);
}

std::string SourceText(const std::string& path) {
  std::ifstream file(test::SourcePath("/" + path), std::ios::binary);
  if (!file) throw std::logic_error(path + " is not there");
  return {std::istreambuf_iterator<char>(file), {}};
}

void AppendPacket(Bytes& input, std::span<const std::uint8_t> packet) {
  input.push_back(static_cast<std::uint8_t>(packet.size()));
  input.push_back(static_cast<std::uint8_t>(packet.size() >> 8));
  input.insert(input.end(), packet.begin(), packet.end());
}

}  // namespace torquer::fuzz
