#include "host/viewer/page_token.h"

#include <fcntl.h>
#include <fmt/format.h>
#include <sys/random.h>
#include <sys/stat.h>
#include <unistd.h>

#include <array>
#include <cerrno>

#include "host/support/atomic_file.h"
#include "host/support/error.h"

namespace torquer::viewer {
namespace {

constexpr std::size_t kDigits = 32;

[[noreturn]] void Refuse(const std::string& path, const std::string& problem) {
  throw UserError(fmt::format("--token-file {}: {}", path, problem));
}

}  // namespace

std::string RandomToken() {
  std::array<unsigned char, kDigits / 2> bytes{};
  if (getrandom(bytes.data(), bytes.size(), 0) != static_cast<ssize_t>(bytes.size())) {
    throw std::runtime_error("the kernel gives no random bytes");
  }
  std::string token;
  for (const unsigned char byte : bytes) token += fmt::format("{:02x}", byte);
  return token;
}

std::string KeptToken(const std::string& path) {
  const int file = open(path.c_str(), O_RDONLY | O_CLOEXEC | O_NOFOLLOW | O_NONBLOCK);
  if (file < 0 && errno == ENOENT) {
    // The file is private to its owner from its creation on.
    const mode_t before = umask(077);
    const std::string token = RandomToken();
    try {
      WriteFileAtomically(path, token);
    } catch (const UserError& error) {
      umask(before);
      throw UserError(std::string("--token-file ") + error.what());
    }
    umask(before);
    return token;
  }
  std::array<char, kDigits + 1> text{};
  struct stat status {};
  const bool usable = file >= 0 && fstat(file, &status) == 0 && S_ISREG(status.st_mode);
  const ssize_t size = usable ? read(file, text.data(), text.size()) : -1;
  if (file >= 0) close(file);
  if (size < 0) Refuse(path, "exists but cannot be read; name another file, or remove this one");
  if (status.st_uid != geteuid() || (status.st_mode & 077) != 0) {
    Refuse(path, "other users may read it; remove it, and the viewer makes a new private one");
  }
  const std::string token(text.data(), static_cast<std::size_t>(size));
  if (token.size() != kDigits || token.find_first_not_of("0123456789abcdef") != std::string::npos) {
    Refuse(path, "holds no token of 32 hexadecimal digits; remove it");
  }
  return token;
}

}  // namespace torquer::viewer
