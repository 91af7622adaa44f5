#include "host/bus/claim.h"

#include <fcntl.h>
#include <fmt/format.h>
#include <sys/file.h>
#include <sys/socket.h>
#include <sys/stat.h>
#include <sys/syscall.h>
#include <unistd.h>

#include <cctype>
#include <cerrno>
#include <cstdint>
#include <cstdlib>
#include <cstring>
#include <ctime>
#include <filesystem>
#include <fstream>
#include <string_view>

#include "host/bus/bus.h"
#include "host/support/error.h"
#include "host/support/fnv1a.h"
#include "host/support/printable_text.h"

namespace torquer::bus {
namespace {

// A claim without a holder is removed when it has not been used for this long.
constexpr std::time_t kStaleAfterS = 24 * 3600;

// The user's id outside of any user namespace, so that the folder is the same inside and outside.
unsigned OuterUserId() {
  const unsigned user = getuid();
  std::ifstream map("/proc/self/uid_map");
  unsigned inside = 0;
  unsigned outside = 0;
  unsigned count = 0;
  while (map >> inside >> outside >> count) {
    if (user >= inside && user - inside < count) return outside + (user - inside);
  }
  return user;
}

std::string ClaimFolder() {
  const char* runtime = std::getenv("XDG_RUNTIME_DIR");
  std::string folder = runtime != nullptr && *runtime != '\0'
                           ? fmt::format("{}/torquer", runtime)
                           : fmt::format("/tmp/torquer-{}", OuterUserId());
  if (mkdir(folder.c_str(), 0700) != 0 && errno != EEXIST) {
    throw UserError(fmt::format(
        "{}: the folder cannot be created: {}; set XDG_RUNTIME_DIR to a folder of yours", folder,
        std::strerror(errno)));
  }
  struct stat status {};
  if (lstat(folder.c_str(), &status) != 0 || !S_ISDIR(status.st_mode) ||
      status.st_uid != getuid() || (status.st_mode & 022) != 0) {
    throw UserError(
        fmt::format("{}: is not a folder that only you can write to; remove it, or set "
                    "XDG_RUNTIME_DIR to a folder of yours",
                    folder));
  }
  return folder;
}

// Opens and locks; -1 when another process holds the lock. Tries again if the file was unlinked
// between opening and locking, because such a lock has no effect.
int OpenLocked(const std::string& path) {
  for (;;) {
    const int fd = open(path.c_str(), O_RDWR | O_CREAT | O_CLOEXEC | O_NOFOLLOW, 0600);
    if (fd < 0) {
      throw UserError(
          fmt::format("{}: cannot be opened: {}; set XDG_RUNTIME_DIR to a folder of yours", path,
                      std::strerror(errno)));
    }
    if (flock(fd, LOCK_EX | LOCK_NB) != 0) {
      close(fd);
      return -1;
    }
    struct stat opened {};
    struct stat named {};
    if (fstat(fd, &opened) == 0 && stat(path.c_str(), &named) == 0 &&
        opened.st_ino == named.st_ino) {
      return fd;
    }
    close(fd);
  }
}

// A second lock, on the first byte of a claim: for this kind, the kernel reports the owner's PID.
struct flock OwnersLock() {
  struct flock lock {};
  lock.l_type = F_WRLCK;
  lock.l_whence = SEEK_SET;
  lock.l_len = 1;
  return lock;
}

std::optional<int> HolderByKernel(int fd) {
  struct flock lock = OwnersLock();
  if (fd < 0 || fcntl(fd, F_GETLK, &lock) != 0 || lock.l_type == F_UNLCK || lock.l_pid <= 0) {
    return std::nullopt;
  }
  return lock.l_pid;
}

// A claim's file, opened without taking its lock; closed on destruction.
struct File {
  explicit File(const std::string& path)
      : fd(open(path.c_str(), O_RDWR | O_CLOEXEC | O_NOFOLLOW | O_NONBLOCK)) {}
  ~File() {
    if (fd >= 0) close(fd);
  }
  File(const File&) = delete;
  File& operator=(const File&) = delete;
  int fd;
};

// A number for this network namespace that no other namespace since the boot shares.
std::string NetworkIdentity() {
#ifdef SO_NETNS_COOKIE
  const int fd = socket(AF_UNIX, SOCK_DGRAM | SOCK_CLOEXEC, 0);
  std::uint64_t cookie = 0;
  socklen_t size = sizeof cookie;
  const bool known = fd >= 0 && getsockopt(fd, SOL_SOCKET, SO_NETNS_COOKIE, &cookie, &size) == 0;
  if (fd >= 0) close(fd);
  if (known) return std::to_string(cookie);
#endif
  struct stat status {};
  stat("/proc/self/ns/net", &status);
  return fmt::format("inode {}", status.st_ino);
}

// For messages only: the process, and its activity.
std::string HolderOf(const std::string& path, std::string& detail) {
  std::ifstream file(path);
  std::string holder;
  file >> holder;
  std::getline(file >> std::ws, detail);
  if (detail.find('\0') != std::string::npos) detail.clear();
  return holder.empty() ? "?" : holder;
}

}  // namespace

std::string ClaimPath(const std::string& name) { return ClaimFolder() + "/" + name; }

void RemoveStaleClaims() {
  std::error_code error;
  for (const auto& entry : std::filesystem::directory_iterator(ClaimFolder(), error)) {
    const std::string path = entry.path().string();
    struct stat status {};
    if (entry.path().extension() != ".claim" || stat(path.c_str(), &status) != 0 ||
        std::time(nullptr) - status.st_mtime < kStaleAfterS) {
      continue;
    }
    const int fd = OpenLocked(path);
    if (fd < 0) continue;
    unlink(path.c_str());
    close(fd);
  }
}

// Makes a safe file name: `readable` may be a path or contain any character.
std::string ClaimName(const std::string& kind, const std::string& readable,
                      const std::string& identity) {
  std::string name = kind + "-";
  for (const char character : readable.substr(0, 32)) {
    const bool plain = std::isalnum(static_cast<unsigned char>(character)) != 0;
    name += plain || character == '-' ? character : '_';
  }
  return fmt::format("{}-{}.claim", name, Hex(Fnv1a(identity)));
}

Claim::Claim(const std::string& name, const ClaimWords& words) {
  const std::string path = ClaimPath(name);
  fd_ = OpenLocked(path);
  if (fd_ < 0) {
    std::string detail;
    const std::string holder = HolderOf(path, detail);
    throw UserError(fmt::format(
        "{} is in use by another {} (process {}{}); stop that one first: kill {}", words.what,
        words.program, holder, detail.empty() ? "" : ", " + Printable(detail), holder));
  }
  struct flock lock = OwnersLock();
  const bool locked = fcntl(fd_, F_SETLK, &lock) == 0;
  std::string holder = fmt::format("{} {}", getpid(), words.detail).substr(0, kRecordOffset - 1);
  holder += '\n';
  holder.resize(kRecordOffset);
  if (!locked ||
      pwrite(fd_, holder.data(), holder.size(), 0) != static_cast<ssize_t>(holder.size())) {
    close(fd_);
    throw UserError(fmt::format("{}: cannot be written: {}; free space in XDG_RUNTIME_DIR", path,
                                std::strerror(errno)));
  }
}

Claim::~Claim() { close(fd_); }

std::optional<int> ClaimHolder(const std::string& name) {
  const File file(ClaimPath(name));
  return HolderByKernel(file.fd);
}

bool SignalClaimHolder(const std::string& name, int signal) {
  const File file(ClaimPath(name));
  const std::optional<int> holder = HolderByKernel(file.fd);
  if (!holder || *holder == getpid()) return false;
  // Called by number: Debian 12's header for these system calls does not compile as C++.
  const auto process = static_cast<int>(syscall(SYS_pidfd_open, *holder, 0));
  if (process < 0) return false;
  // Check again: if the opened process still holds the claim, no other process has taken its PID.
  const bool sent = HolderByKernel(file.fd) == holder &&
                    syscall(SYS_pidfd_send_signal, process, signal, nullptr, 0) == 0;
  close(process);
  return sent;
}

std::string BusClaimName(const std::string& kind, const std::string& thing,
                         const std::string& lcm_url) {
  const std::string url = lcm_url.empty() ? DefaultUrl() : lcm_url;
  return ClaimName(kind, thing, thing + "\n" + url + "\n" + NetworkIdentity());
}

}  // namespace torquer::bus
