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
#include <vector>

#include "host/support/error.h"
#include "host/support/file_kind.h"

namespace torquer {
namespace {

constexpr int kMostLinks = 40;  // limit of Linux
constexpr char kRemedy[] = "name a file in a folder that exists and that you may write to";
constexpr char kRoomRemedy[] = "free space on the disk, or name a file elsewhere";

[[noreturn]] void Refuse(const std::string& path, const std::string& problem) {
  throw UserError(fmt::format("{}: cannot be written: {}", path, problem));
}

// Target of the last symbolic link; it need not exist.
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

std::string FolderOf(const std::string& file) {
  const std::string folder = std::filesystem::path(file).parent_path();
  return folder.empty() ? "." : folder;
}

// Next name for a file beside the target, because a rename cannot leave its file system. It is
// short, because the target's name may have the maximum length.
std::string TemporaryName(const std::string& target) {
  static std::atomic<unsigned> count{0};
  return fmt::format("{}/.torquer-{}-{}.tmp", FolderOf(target), getpid(), ++count);
}

std::string LinkTo(int fd) { return fmt::format("/proc/self/fd/{}", fd); }

// Creates a file in the same folder. It is unnamed if the file system supports that, so that a
// killed process leaves no file. Otherwise it has a new name. Returns the descriptor, or -1 with
// errno.
int CreateBeside(const std::string& target, std::string& temporary) {
  int fd = open(FolderOf(target).c_str(), O_WRONLY | O_TMPFILE | O_CLOEXEC, 0666);
  if (fd >= 0 && access(LinkTo(fd).c_str(), F_OK) == 0) return fd;
  if (fd >= 0) close(fd);
  for (;;) {
    temporary = TemporaryName(target);
    fd = open(temporary.c_str(), O_WRONLY | O_CREAT | O_EXCL | O_CLOEXEC, 0666);
    if (fd >= 0 || errno != EEXIST) return fd;
  }
}

// A folder that is writable but not readable cannot be opened. Then syncfs on the file syncs its
// file system. Some network file systems cannot sync a folder and need not.
void SyncFolder(const std::string& path, const std::string& file) {
  const int folder = open(FolderOf(file).c_str(), O_RDONLY | O_DIRECTORY | O_CLOEXEC);
  const int fd = folder >= 0 ? folder : open(file.c_str(), O_WRONLY | O_CLOEXEC);
  const int status = folder >= 0 ? fsync(fd) : syncfs(fd);
  const bool failed = status != 0 && errno != EINVAL && errno != ENOTSUP;
  const int reason = errno;
  if (fd >= 0) close(fd);
  if (!failed) return;
  throw UserError(fmt::format("{}: was written, but its folder cannot be synced to the disk: {}",
                              path, std::strerror(reason)));
}

}  // namespace

// Stream buffer over a file descriptor, so that the file can be synced. It keeps the errno of the
// first failure.
class AtomicFile::Buffer : public std::streambuf {
 public:
  explicit Buffer(int fd) : fd_(fd) { setp(bytes_.data(), bytes_.data() + bytes_.size()); }
  ~Buffer() override { Close(); }
  Buffer(const Buffer&) = delete;
  Buffer& operator=(const Buffer&) = delete;

  int fd() const { return fd_; }
  std::int64_t kept() const { return kept_; }

  int Reserve(std::int64_t bytes) {
    int error = 0;
    do {
      error = posix_fallocate(fd_, 0, bytes);
    } while (error == EINTR);
    if (error == 0) reserved_ = true;
    return error;
  }

  bool KeepSoFar() {
    if (error_ == 0) marks_.push_back(written_ + (pptr() - pbase()));
    return error_ == 0;
  }

  /// Writes and syncs everything. Returns 0, or the errno of the first failure.
  int Sync() {
    sync();
    if (error_ == 0 && reserved_ && ftruncate(fd_, written_) != 0) error_ = errno;
    if (error_ == 0 && fsync(fd_) != 0) error_ = errno;
    return error_;
  }

  /// Cuts the file to the part to be kept, so that this part can be closed normally. Returns true
  /// if it is safe on the disk.
  bool CutToKept() {
    error_ = 0;
    return ftruncate(fd_, kept_) == 0 && fsync(fd_) == 0;
  }

  int Close() {
    if (fd_ >= 0 && close(fd_) != 0 && error_ == 0) error_ = errno;
    fd_ = -1;
    return error_;
  }

 protected:
  int sync() override {
    for (const char* next = pbase(); next < pptr() && error_ == 0;) {
      const ssize_t written = write(fd_, next, static_cast<std::size_t>(pptr() - next));
      if (written > 0) {
        next += written;
        written_ += written;
      }
      if (written < 0 && errno != EINTR) error_ = errno;
    }
    setp(bytes_.data(), bytes_.data() + bytes_.size());
    for (const std::int64_t mark : marks_) {
      if (mark <= written_) kept_ = mark;
    }
    marks_.clear();
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
  bool reserved_ = false;
  std::int64_t written_ = 0;
  std::int64_t kept_ = 0;            // newest mark that was written
  std::vector<std::int64_t> marks_;  // marks in the data still in memory
  std::array<char, 65536> bytes_{};
};

AtomicFile::AtomicFile(const std::string& path)
    : path_(path), target_(FollowLinks(path)), out_(nullptr) {
  if (std::filesystem::path(target_).filename().empty()) {
    Refuse(path_, fmt::format("it names no file; {}", kRemedy));
  }
  struct stat existing {};
  const bool exists = stat(target_.c_str(), &existing) == 0;
  if (!exists && errno != ENOENT) {
    Refuse(path_, fmt::format("{}; {}", std::strerror(errno), kRemedy));
  }
  if (exists && !S_ISREG(existing.st_mode)) {
    Refuse(path_,
           fmt::format("it is {}, which is not replaced; name an ordinary file or one that does "
                       "not exist",
                       FileKind(existing.st_mode)));
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

int AtomicFile::descriptor() const { return buffer_->fd(); }

void AtomicFile::Reserve(std::int64_t bytes) {
  const int error = buffer_->Reserve(bytes);
  // On a file system that cannot reserve space, a full disk shows only at the write.
  if (error == 0 || error == EOPNOTSUPP || error == EINVAL) return;
  Refuse(path_, fmt::format("{}; {}", std::strerror(error), kRoomRemedy));
}

bool AtomicFile::KeepSoFar() { return buffer_->KeepSoFar(); }

// Gives an unnamed file a name, closes it, and renames it. Returns the reason of a failure, or "".
std::string AtomicFile::NameIt(const std::string& name) {
  while (temporary_.empty()) {
    const std::string link = TemporaryName(target_);
    const int status =
        linkat(AT_FDCWD, LinkTo(buffer_->fd()).c_str(), AT_FDCWD, link.c_str(), AT_SYMLINK_FOLLOW);
    if (status == 0) temporary_ = link;
    if (status != 0 && errno != EEXIST) return std::strerror(errno);
  }
  if (const int error = buffer_->Close(); error != 0) return std::strerror(error);
  if (rename(temporary_.c_str(), name.c_str()) != 0) return std::strerror(errno);
  temporary_.clear();
  return "";
}

// Keeps the data up to the last KeepSoFar(). Returns a part of the message about it.
std::string AtomicFile::SavePartial() {
  if (buffer_->kept() == 0 || buffer_->fd() < 0 || !buffer_->CutToKept()) return "";
  const std::string name = target_ + ".partial";
  if (!NameIt(name).empty()) return "";
  return fmt::format("its first {} bytes are complete and kept in {}, and the rest is lost; ",
                     buffer_->kept(), name);
}

void AtomicFile::Finish() {
  const int error = buffer_->Sync();
  const std::string reason = error != 0 ? std::strerror(error) : NameIt(target_);
  if (!reason.empty()) {
    const std::string partial = SavePartial();
    if (!temporary_.empty()) unlink(temporary_.c_str());
    temporary_.clear();
    Refuse(path_, fmt::format("{}; {}{}", reason, partial, kRoomRemedy));
  }
  SyncFolder(path_, target_);
}

void WriteFileAtomically(const std::string& path, std::string_view contents) {
  AtomicFile file(path);
  file.out().write(contents.data(), static_cast<std::streamsize>(contents.size()));
  file.Finish();
}

}  // namespace torquer
