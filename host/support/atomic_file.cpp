#include "host/support/atomic_file.h"

#include <fcntl.h>
#include <fmt/format.h>
#include <sys/stat.h>
#include <unistd.h>

#include <array>
#include <atomic>
#include <cerrno>
#include <cstdio>
#include <cstring>
#include <filesystem>
#include <streambuf>

#include "host/support/error.h"

namespace torquer {
namespace {

constexpr int kMostLinks = 40;  // as Linux follows at most
constexpr char kRemedy[] = "name a file in a folder that exists and that you may write to";

[[noreturn]] void Refuse(const std::string& path, const std::string& problem) {
  throw UserError(fmt::format("{}: cannot be written: {}", path, problem));
}

// What stands behind the last of the symbolic links; it need not exist.
std::filesystem::path FollowLinks(const std::string& path) {
  std::filesystem::path target = path;
  std::error_code error;
  for (int i = 0; i < kMostLinks; ++i) {
    if (!std::filesystem::is_symlink(std::filesystem::symlink_status(target, error))) return target;
    const std::filesystem::path link = std::filesystem::read_symlink(target, error);
    if (error) Refuse(path, error.message());
    target = target.parent_path() / link;  // an absolute link replaces the left side
  }
  Refuse(path, "its symbolic links form a loop; name an ordinary file");
}

const char* KindOf(mode_t mode) {
  switch (mode & S_IFMT) {
    case S_IFDIR:
      return "a folder";
    case S_IFCHR:
    case S_IFBLK:
      return "a device";
    case S_IFIFO:
      return "a pipe";
    case S_IFSOCK:
      return "a socket";
    default:
      return "not an ordinary file";
  }
}

std::string FolderOf(const std::string& file) {
  const std::string folder = std::filesystem::path(file).parent_path();
  return folder.empty() ? "." : folder;
}

// Creates a new file in the same folder, since a rename cannot leave its file system. Its name is
// short, since the target's name may be as long as names can be, and skips what a killed process
// left. The file descriptor, or -1 with errno.
int CreateBeside(const std::string& target, std::string& temporary) {
  static std::atomic<unsigned> count{0};
  for (;;) {
    temporary = fmt::format("{}/.torquer-{}-{}.tmp", FolderOf(target), getpid(), ++count);
    const int fd = open(temporary.c_str(), O_WRONLY | O_CREAT | O_EXCL | O_CLOEXEC, 0666);
    if (fd >= 0 || errno != EEXIST) return fd;
  }
}

void SyncFolder(const std::string& path, const std::string& folder) {
  const int fd = open(folder.c_str(), O_RDONLY | O_DIRECTORY | O_CLOEXEC);
  // Some network file systems cannot sync a folder and need not.
  const bool failed = fd < 0 || (fsync(fd) != 0 && errno != EINVAL && errno != ENOTSUP);
  const int reason = errno;
  if (fd >= 0) close(fd);
  if (!failed) return;
  throw UserError(fmt::format("{}: was written, but its folder cannot be synced to the disk: {}",
                              path, std::strerror(reason)));
}

}  // namespace

// A stream buffer over a file descriptor, so that the file can be synced; it keeps the errno of the
// first failure.
class AtomicFile::Buffer : public std::streambuf {
 public:
  explicit Buffer(int fd) : fd_(fd) { setp(bytes_.data(), bytes_.data() + bytes_.size()); }
  ~Buffer() override {
    if (fd_ >= 0) close(fd_);
  }
  Buffer(const Buffer&) = delete;
  Buffer& operator=(const Buffer&) = delete;

  /// Writes and syncs everything, and closes the file. 0, or the errno of the first failure.
  int Close() {
    sync();
    if (error_ == 0 && fsync(fd_) != 0) error_ = errno;
    if (close(fd_) != 0 && error_ == 0) error_ = errno;
    fd_ = -1;
    return error_;
  }

 protected:
  int sync() override {
    for (const char* next = pbase(); next < pptr() && error_ == 0;) {
      const ssize_t written = write(fd_, next, static_cast<std::size_t>(pptr() - next));
      if (written > 0) next += written;
      if (written < 0 && errno != EINTR) error_ = errno;
    }
    setp(bytes_.data(), bytes_.data() + bytes_.size());
    return error_ == 0 ? 0 : -1;
  }

  int_type overflow(int_type character) override {
    if (sync() != 0) return traits_type::eof();
    if (traits_type::eq_int_type(character, traits_type::eof())) return 0;
    return sputc(traits_type::to_char_type(character));
  }

 private:
  int fd_;
  int error_ = 0;
  std::array<char, 65536> bytes_{};
};

AtomicFile::AtomicFile(const std::string& path)
    : path_(path), target_(FollowLinks(path)), out_(nullptr) {
  if (std::filesystem::path(target_).filename().empty()) {
    Refuse(path_, fmt::format("it names no file; {}", kRemedy));
  }
  struct stat existing {};
  const bool exists = stat(target_.c_str(), &existing) == 0;
  if (exists && !S_ISREG(existing.st_mode)) {
    Refuse(path_,
           fmt::format("it is {}, which is not replaced; name an ordinary file or one that does "
                       "not exist",
                       KindOf(existing.st_mode)));
  }
  if (exists && access(target_.c_str(), W_OK) != 0) {
    Refuse(path_, "it is write-protected; allow writing (chmod u+w), or name another file");
  }
  std::string temporary;
  const int fd = CreateBeside(target_, temporary);
  if (fd < 0) Refuse(path_, fmt::format("{}; {}", std::strerror(errno), kRemedy));
  temporary_ = temporary;
  buffer_ = std::make_unique<Buffer>(fd);
  out_.rdbuf(buffer_.get());
  if (exists) static_cast<void>(fchmod(fd, existing.st_mode & 07777));
}

AtomicFile::~AtomicFile() {
  if (!temporary_.empty()) unlink(temporary_.c_str());
}

void AtomicFile::Finish() {
  int error = buffer_->Close();
  if (error == 0 && rename(temporary_.c_str(), target_.c_str()) != 0) error = errno;
  if (error != 0) {
    unlink(temporary_.c_str());
    temporary_.clear();
    Refuse(path_, fmt::format("{}; free space on the disk, or name a file elsewhere",
                              std::strerror(error)));
  }
  temporary_.clear();
  SyncFolder(path_, FolderOf(target_));
}

void WriteFileAtomically(const std::string& path, std::string_view contents) {
  AtomicFile file(path);
  file.out().write(contents.data(), static_cast<std::streamsize>(contents.size()));
  file.Finish();
}

}  // namespace torquer
