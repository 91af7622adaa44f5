// Preloaded library (LD_PRELOAD) that replaces the C library's file and clock functions. A program
// then meets a disk or a clock that fails at one chosen step. Environment variables:
//
//   TORQUER_FAULT_UNDER   folder: only steps on files below it count
//   TORQUER_FAULT_LOG     file that gets a line for each counted step: function and file
//   TORQUER_FAULT_KIND    ENOSPC, EIO, EACCES or EROFS: error of the failing step; KILL: the
//   process
//                         is killed at that step
//   TORQUER_FAULT_AT      number of the failing step, from 1 on; 0: none
//   TORQUER_FREE_BYTES    file that contains the number of free bytes on the disk
//   TORQUER_CLOCK_JUMP_S  the wall clock jumps ahead by this time and back, 10 times a second
//
// A full disk stays full, and read-only mounts and permissions persist; a device error occurs once.
// Only steps that can fail in the selected way are counted.
#include <dlfcn.h>
#include <fcntl.h>
#include <sys/stat.h>
#include <sys/statvfs.h>
#include <sys/syscall.h>
#include <sys/time.h>
#include <sys/uio.h>
#include <unistd.h>

#include <atomic>
#include <cerrno>
#include <csignal>
#include <cstdarg>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <ctime>

namespace {

enum class Step { kOpen, kMake, kWrite, kSync, kName, kCut, kRemove };

struct Kind {
  const char* name;
  int error;  // 0: the process is killed
  bool lasts;
  bool (*concerns)(Step step);
};
const Kind kKinds[] = {
    {"ENOSPC", ENOSPC, true,
     [](Step step) {
       return step == Step::kMake || step == Step::kWrite || step == Step::kSync ||
              step == Step::kName;
     }},
    {"EIO", EIO, false, [](Step) { return true; }},
    {"EACCES", EACCES, true,
     [](Step step) {
       return step == Step::kOpen || step == Step::kMake || step == Step::kName ||
              step == Step::kRemove;
     }},
    {"EROFS", EROFS, true, [](Step step) { return step != Step::kSync; }},
    {"KILL", 0, false, [](Step) { return true; }},
};

std::atomic<int> steps{0};

const char* Asked(const char* name) {
  const char* value = getenv(name);
  return value == nullptr ? "" : value;
}

const Kind* AskedKind() {
  for (const Kind& kind : kKinds) {
    if (std::strcmp(kind.name, Asked("TORQUER_FAULT_KIND")) == 0) return &kind;
  }
  return nullptr;
}

void Note(const char* what, const char* path) {
  const auto file = static_cast<int>(syscall(SYS_openat, AT_FDCWD, Asked("TORQUER_FAULT_LOG"),
                                             O_WRONLY | O_CREAT | O_APPEND | O_CLOEXEC, 0600));
  char line[512];
  const int size = std::snprintf(line, sizeof line, "%s %s\n", what, path);
  syscall(SYS_write, file, line, size);
  syscall(SYS_close, file);
}

// True if this step fails; errno is then the error.
bool Fails(Step step, const char* what, const char* path) {
  const char* under = Asked("TORQUER_FAULT_UNDER");
  const Kind* kind = AskedKind();
  if (kind == nullptr || *under == '\0' || std::strncmp(path, under, std::strlen(under)) != 0 ||
      !kind->concerns(step)) {
    return false;
  }
  const int number = ++steps;
  Note(what, path);
  const int at = std::atoi(Asked("TORQUER_FAULT_AT"));
  const bool now = number == at || (kind->lasts && at > 0 && number > at);
  if (now && kind->error == 0) kill(getpid(), SIGKILL);
  if (now) errno = kind->error;
  return now;
}

bool FailsOn(Step step, const char* what, int file) {
  char link[64];
  char path[512] = "";
  std::snprintf(link, sizeof link, "/proc/self/fd/%d", file);
  const int before = errno;
  const ssize_t size = readlink(link, path, sizeof path - 1);
  errno = before;
  if (size <= 0 || path[0] != '/') return false;
  path[size] = '\0';
  return Fails(step, what, path);
}

// The C library's function `name`, with the type of the replacement here.
template <class Function>
Function* Real(const char* name, Function* /*here*/) {
  return reinterpret_cast<Function*>(dlsym(RTLD_NEXT, name));
}

// An open() without write access never fails here.
bool OpenFails(const char* path, int flags) {
  if ((flags & O_ACCMODE) == O_RDONLY) return false;
  const bool makes = (flags & (O_CREAT | O_TMPFILE)) != 0;
  return Fails(makes ? Step::kMake : Step::kOpen, "open", path);
}

bool TakesMode(int flags) { return (flags & O_CREAT) != 0 || (flags & O_TMPFILE) == O_TMPFILE; }

mode_t ModeOf(int flags, va_list arguments) {
  return TakesMode(flags) ? va_arg(arguments, mode_t) : 0;
}

// The write that fills the disk still stores half of its data.
ssize_t WriteUntilFull(int file, const void* bytes, std::size_t size) {
  const bool filled = steps == std::atoi(Asked("TORQUER_FAULT_AT"));
  if (errno != ENOSPC || size < 2 || !filled) return -1;
  return syscall(SYS_write, file, bytes, size / 2);
}

}  // namespace

// Exported replacements, called by the program under test.
#pragma GCC visibility push(default)
extern "C" {

int open(const char* path, int flags, ...) {
  va_list arguments;
  va_start(arguments, flags);
  const mode_t mode = ModeOf(flags, arguments);
  va_end(arguments);
  if (OpenFails(path, flags)) return -1;
  return static_cast<int>(syscall(SYS_openat, AT_FDCWD, path, flags, mode));
}

int open64(const char* path, int flags, ...) {
  va_list arguments;
  va_start(arguments, flags);
  const mode_t mode = ModeOf(flags, arguments);
  va_end(arguments);
  return open(path, flags, mode);
}

FILE* fopen64(const char* path, const char* mode) {
  const bool writes = std::strpbrk(mode, "wa+") != nullptr;
  if (writes && Fails(Step::kMake, "fopen", path)) return nullptr;
  return Real("fopen64", &fopen64)(path, mode);
}

FILE* fopen(const char* path, const char* mode) { return fopen64(path, mode); }

int mkostemp(char* path, int flags) {
  if (Fails(Step::kMake, "mkostemp", path)) return -1;
  return Real("mkostemp", &mkostemp)(path, flags);
}

int mkdir(const char* path, mode_t mode) noexcept {
  // An existing folder is not a step, because no data are written.
  struct stat status {};
  const bool there = stat(path, &status) == 0;
  if (!there && Fails(Step::kMake, "mkdir", path)) return -1;
  return static_cast<int>(syscall(SYS_mkdirat, AT_FDCWD, path, mode));
}

ssize_t write(int file, const void* bytes, std::size_t size) {
  if (FailsOn(Step::kWrite, "write", file)) return WriteUntilFull(file, bytes, size);
  return syscall(SYS_write, file, bytes, size);
}

ssize_t pwrite(int file, const void* bytes, std::size_t size, off_t offset) {
  if (FailsOn(Step::kWrite, "pwrite", file)) return -1;
  return syscall(SYS_pwrite64, file, bytes, size, offset);
}

ssize_t writev(int file, const iovec* parts, int count) {
  if (FailsOn(Step::kWrite, "writev", file)) return -1;
  return syscall(SYS_writev, file, parts, count);
}

int fsync(int file) {
  if (FailsOn(Step::kSync, "fsync", file)) return -1;
  return static_cast<int>(syscall(SYS_fsync, file));
}

int ftruncate(int file, off_t size) noexcept {
  if (FailsOn(Step::kCut, "ftruncate", file)) return -1;
  return static_cast<int>(syscall(SYS_ftruncate, file, size));
}

int posix_fallocate(int file, off_t offset, off_t size) {
  const int before = errno;
  if (FailsOn(Step::kWrite, "posix_fallocate", file)) {
    const int error = errno;
    errno = before;  // the error is the return value; errno stays
    return error;
  }
  return Real("posix_fallocate", &posix_fallocate)(file, offset, size);
}

int rename(const char* from, const char* to) noexcept {
  if (Fails(Step::kName, "rename", to)) return -1;
  return static_cast<int>(syscall(SYS_renameat2, AT_FDCWD, from, AT_FDCWD, to, 0));
}

int linkat(int from_folder, const char* from, int to_folder, const char* to, int flags) noexcept {
  if (Fails(Step::kName, "linkat", to)) return -1;
  return static_cast<int>(syscall(SYS_linkat, from_folder, from, to_folder, to, flags));
}

int unlink(const char* path) noexcept {
  if (Fails(Step::kRemove, "unlink", path)) return -1;
  return static_cast<int>(syscall(SYS_unlinkat, AT_FDCWD, path, 0));
}

int remove(const char* path) noexcept { return unlink(path); }

int statvfs(const char* path, struct statvfs* disk) noexcept {
  const int status = Real("statvfs", &statvfs)(path, disk);
  const auto file = static_cast<int>(
      syscall(SYS_openat, AT_FDCWD, Asked("TORQUER_FREE_BYTES"), O_RDONLY | O_CLOEXEC));
  char text[32] = "";
  if (file >= 0 && syscall(SYS_read, file, text, sizeof text - 1) > 0) {
    disk->f_frsize = 1;
    disk->f_bavail = static_cast<fsblkcnt_t>(std::atoll(text));
  }
  if (file >= 0) syscall(SYS_close, file);
  return status;
}

int clock_gettime(clockid_t clock, timespec* now) noexcept {
  const auto status = static_cast<int>(syscall(SYS_clock_gettime, clock, now));
  const char* jump = Asked("TORQUER_CLOCK_JUMP_S");
  if (clock != CLOCK_REALTIME || *jump == '\0') return status;
  timespec steady{};
  syscall(SYS_clock_gettime, CLOCK_MONOTONIC, &steady);
  if (steady.tv_nsec / 50'000'000 % 2 != 0) now->tv_sec += std::atoll(jump);
  return status;
}

time_t time(time_t* to) noexcept {
  timespec now{};
  clock_gettime(CLOCK_REALTIME, &now);
  if (to != nullptr) *to = now.tv_sec;
  return now.tv_sec;
}

int gettimeofday(timeval* to, void*) noexcept {
  timespec now{};
  clock_gettime(CLOCK_REALTIME, &now);
  to->tv_sec = now.tv_sec;
  to->tv_usec = now.tv_nsec / 1000;
  return 0;
}

}  // extern "C"
#pragma GCC visibility pop
