#include "host/daemon/claim.h"

#include <fcntl.h>
#include <fmt/format.h>
#include <sys/file.h>
#include <sys/mman.h>
#include <sys/socket.h>
#include <sys/stat.h>
#include <sys/syscall.h>
#include <unistd.h>

#include <cerrno>
#include <cstdlib>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <string_view>
#include <type_traits>

#include "host/bus/bus.h"
#include "host/support/error.h"
#include "host/support/fnv1a.h"

namespace torquer::daemon {
namespace {

// Claims begin with the holder's process id; a record may follow.
constexpr off_t kRecordOffset = 64;
// A claim without a holder is removed when it was not used for this long.
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

std::string PathOf(const std::string& name) { return ClaimFolder() + "/" + name; }

// Opens and locks; -1 when another process holds the lock. Tries again when the file was unlinked
// between opening and locking, since a lock on it would lock nothing.
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

// The first byte of a claim is locked a second time, by a lock of which the kernel says who has it.
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

// A claim, opened to look at.
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

// For messages only.
std::string HolderOf(const std::string& path) {
  std::ifstream file(path);
  std::string holder;
  file >> holder;
  return holder.empty() ? "?" : holder;
}

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

// A file name of what may be a path or hold any character.
std::string FileName(const std::string& kind, const std::string& readable,
                     const std::string& identity) {
  std::string name = kind + "-";
  for (const char character : readable.substr(0, 32)) {
    const bool plain = std::isalnum(static_cast<unsigned char>(character)) != 0;
    name += plain || character == '-' ? character : '_';
  }
  return fmt::format("{}-{}.claim", name, Hex(Fnv1a(identity)));
}

}  // namespace

Claim::Claim(const std::string& name, const std::string& what) {
  const std::string path = PathOf(name);
  fd_ = OpenLocked(path);
  if (fd_ < 0) {
    throw UserError(fmt::format(
        "{} is in use by another torquer-daemon (process {}); stop that one first: kill {}", what,
        HolderOf(path), HolderOf(path)));
  }
  struct flock lock = OwnersLock();
  const bool locked = fcntl(fd_, F_SETLK, &lock) == 0;
  std::string holder = fmt::format("{}\n", getpid());
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
  const File file(PathOf(name));
  return HolderByKernel(file.fd);
}

bool SignalClaimHolder(const std::string& name, int signal) {
  const File file(PathOf(name));
  const std::optional<int> holder = HolderByKernel(file.fd);
  if (!holder || *holder == getpid()) return false;
  // By number: the header of Debian 12 for these calls is not one for C++.
  const auto process = static_cast<int>(syscall(SYS_pidfd_open, *holder, 0));
  if (process < 0) return false;
  // Who still holds it now is the process that was opened, and not one that took its number.
  const bool sent = HolderByKernel(file.fd) == holder &&
                    syscall(SYS_pidfd_send_signal, process, signal, nullptr, 0) == 0;
  close(process);
  return sent;
}

std::string DeviceClaimName(const std::string& device) {
  return FileName("device", std::filesystem::path(device).filename().string(), device);
}

std::string InstrumentClaimName(const std::string& instrument, const std::string& lcm_url) {
  const std::string url = lcm_url.empty() ? bus::DefaultUrl() : lcm_url;
  return FileName("instrument", instrument, instrument + "\n" + url + "\n" + NetworkIdentity());
}

// Two slots, written in turn, each with a checksum: one of them is always complete.
struct InstrumentClaim::Record {
  struct Slot {
    std::uint64_t count;
    LastCommand command;
    std::uint64_t checksum;
  };
  Slot slots[2];

  static std::uint64_t Checksum(const Slot& slot) {
    return Fnv1a({reinterpret_cast<const char*>(&slot), offsetof(Slot, checksum)});
  }
};

InstrumentClaim::InstrumentClaim(const std::string& instrument, const std::string& lcm_url)
    : claim_(InstrumentClaimName(instrument, lcm_url),
             fmt::format("the instrument '{}'", instrument)) {
  static_assert(std::is_trivially_copyable_v<Record>);
  RemoveStaleClaims();
  constexpr std::size_t kSize = kRecordOffset + sizeof(Record);
  void* memory = MAP_FAILED;
  // posix_fallocate: a full file system is found here, not by a SIGBUS at the first store.
  int reason = 0;
  do {
    reason = posix_fallocate(claim_.file(), 0, kSize);
  } while (reason == EINTR);
  if (reason == 0) {
    memory = mmap(nullptr, kSize, PROT_READ | PROT_WRITE, MAP_SHARED, claim_.file(), 0);
    reason = errno;
  }
  if (memory == MAP_FAILED) {
    throw UserError(fmt::format(
        "{}: the last position of '{}' cannot be kept: {}; free space in XDG_RUNTIME_DIR",
        PathOf(InstrumentClaimName(instrument, lcm_url)), instrument, std::strerror(reason)));
  }
  record_ = reinterpret_cast<Record*>(static_cast<char*>(memory) + kRecordOffset);
  for (const Record::Slot& slot : record_->slots) {
    if (slot.count == 0 || slot.checksum != Record::Checksum(slot)) continue;
    if (slot.count <= count_) continue;
    count_ = slot.count;
    previous_ = slot.command;
  }
}

InstrumentClaim::~InstrumentClaim() {
  munmap(reinterpret_cast<char*>(record_) - kRecordOffset, kRecordOffset + sizeof(Record));
}

void InstrumentClaim::Remember(const LastCommand& command) {
  ++count_;
  Record::Slot slot{};
  slot.count = count_;
  slot.command = command;
  slot.checksum = Record::Checksum(slot);
  std::memcpy(&record_->slots[count_ % 2], &slot, sizeof slot);
}

}  // namespace torquer::daemon
