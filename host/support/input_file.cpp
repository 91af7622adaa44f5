#include "host/support/input_file.h"

#include <fcntl.h>
#include <fmt/format.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cstring>

#include "host/support/error.h"
#include "host/support/file_kind.h"

namespace torquer {

InputFile::InputFile(const std::string& path, const std::string& remedy)
    : path_(path), remedy_(remedy) {
  struct stat status {};
  if (stat(path.c_str(), &status) != 0) Refuse(std::strerror(errno));
  // Checked before the opening, which would wake the writer of a pipe, or start a device.
  if (!S_ISREG(status.st_mode)) Refuse(std::string("it is ") + FileKind(status.st_mode));
  // Does not wait if a pipe replaces the file meanwhile.
  fd_ = open(path.c_str(), O_RDONLY | O_CLOEXEC | O_NONBLOCK | O_NOCTTY);
  if (fd_ < 0) Refuse(std::strerror(errno));
  if (fstat(fd_, &status) == 0 && S_ISREG(status.st_mode)) {
    bytes_ = status.st_size;
    return;
  }
  close(fd_);
  Refuse(std::string("it is ") + FileKind(status.st_mode));
}

InputFile::~InputFile() { close(fd_); }

void InputFile::Refuse(const std::string& reason) const {
  throw UserError(fmt::format("{}: cannot be read: {}; {}", path_, reason, remedy_));
}

std::size_t InputFile::ReadAt(std::int64_t offset, void* to, std::size_t size) const {
  std::size_t done = 0;
  while (done < size) {
    const ssize_t got = pread(fd_, static_cast<char*>(to) + done, size - done,
                              offset + static_cast<std::int64_t>(done));
    if (got < 0 && errno == EINTR) continue;
    if (got < 0) Refuse(std::strerror(errno));
    if (got == 0) break;
    done += static_cast<std::size_t>(got);
  }
  return done;
}

std::string ReadInputFile(const std::string& path, const std::string& remedy,
                          std::int64_t most_bytes) {
  const InputFile file(path, remedy);
  if (file.bytes() > most_bytes) {
    throw UserError(fmt::format("{}: has {} bytes, and at most {} are read; {}", path, file.bytes(),
                                most_bytes, remedy));
  }
  // Files of the kernel report a size of 0, so only the end of the data counts.
  std::string contents;
  constexpr std::int64_t kLeast = 4096;
  auto step = static_cast<std::size_t>(std::max(file.bytes() + 1, kLeast));
  for (;;) {
    const std::size_t before = contents.size();
    contents.resize(before + step);
    const std::size_t got =
        file.ReadAt(static_cast<std::int64_t>(before), contents.data() + before, step);
    contents.resize(before + got);
    if (got < step || static_cast<std::int64_t>(contents.size()) > most_bytes) return contents;
    step = contents.size();
  }
}

}  // namespace torquer
