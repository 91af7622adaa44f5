#include "host/support/error_output.h"

#include <fcntl.h>
#include <poll.h>
#include <unistd.h>

#include <cerrno>
#include <csignal>
#include <ctime>

#include "host/support/printable_text.h"

namespace torquer {
namespace {

constexpr std::size_t kMostBytesOfLine = 10'000;
constexpr int kWaitForRoomMs = 200;

// Blocks SIGPIPE in this thread, so that a reader of messages that goes away does not end the
// program.
class WithoutPipeSignal {
 public:
  WithoutPipeSignal() noexcept {
    sigemptyset(&pipe_);
    sigaddset(&pipe_, SIGPIPE);
    sigset_t pending;
    sigpending(&pending);
    was_pending_ = sigismember(&pending, SIGPIPE) == 1;
    pthread_sigmask(SIG_BLOCK, &pipe_, &before_);
  }
  ~WithoutPipeSignal() {
    const timespec at_once = {};
    if (!was_pending_) sigtimedwait(&pipe_, nullptr, &at_once);
    pthread_sigmask(SIG_SETMASK, &before_, nullptr);
  }
  WithoutPipeSignal(const WithoutPipeSignal&) = delete;
  WithoutPipeSignal& operator=(const WithoutPipeSignal&) = delete;

 private:
  sigset_t pipe_;
  sigset_t before_;
  bool was_pending_ = false;
};

std::string PrintableLinesOf(std::string_view text) {
  std::string out;
  for (std::size_t end = 0; (end = text.find('\n')) != std::string_view::npos;) {
    out += Printable(text.substr(0, end), kMostBytesOfLine) + "\n";
    text.remove_prefix(end + 1);
  }
  return out + Printable(text, kMostBytesOfLine);
}

}  // namespace

void OccupyStandardStreams() noexcept {
  for (int stream = STDIN_FILENO; stream <= STDERR_FILENO; ++stream) {
    if (fcntl(stream, F_GETFD) >= 0 || errno != EBADF) continue;
    // open() uses the lowest free number, which is this one. The wrong mode makes every use fail.
    const int mode = stream == STDIN_FILENO ? O_WRONLY : O_RDONLY;
    if (open("/dev/null", mode) < 0) return;
  }
}

void WriteProgress(std::string_view text) noexcept {
  const int before = errno;
  const WithoutPipeSignal without_signal;
  while (!text.empty()) {
    const ssize_t written = write(STDERR_FILENO, text.data(), text.size());
    if (written > 0) {
      text.remove_prefix(static_cast<std::size_t>(written));
    } else if (written < 0 && errno == EAGAIN) {
      pollfd room = {STDERR_FILENO, POLLOUT, 0};
      if (poll(&room, 1, kWaitForRoomMs) == 0) break;
    } else if (written == 0 || errno != EINTR) {
      break;
    }
  }
  errno = before;
}

void WriteError(std::string_view text) noexcept {
  try {
    WriteProgress(PrintableLinesOf(text));
  } catch (const std::exception&) {
    WriteProgress("a message cannot be shown for lack of memory\n");
  }
}

std::string RemedyOf(const std::error_code& error) {
  if (error == std::errc::too_many_files_open) return "raise the limit of open files (ulimit -n)";
  if (error == std::errc::too_many_files_open_in_system) return "close other programs";
  if (error == std::errc::not_enough_memory) {
    return "close other programs, or raise the limit of memory (ulimit -v)";
  }
  if (error == std::errc::resource_unavailable_try_again) {
    return "close other programs, or raise the limit of processes and threads (ulimit -u)";
  }
  if (error == std::errc::no_space_on_device) return "free space on the disk";
  if (error.value() == EDQUOT) return "free space in your disk quota";
  if (error == std::errc::file_too_large) return "raise the limit of a file's size (ulimit -f)";
  if (error == std::errc::permission_denied || error == std::errc::operation_not_permitted) {
    return "check the permissions";
  }
  if (error == std::errc::no_such_file_or_directory || error == std::errc::not_a_directory) {
    return "check the path";
  }
  if (error == std::errc::read_only_file_system) return "choose a writable folder";
  if (error == std::errc::io_error || error == std::errc::bad_file_descriptor) {
    return "is the disk full, or the stream closed?";
  }
  if (error == std::errc::filename_too_long) return "choose a shorter path";
  if (error == std::errc::too_many_symbolic_link_levels) return "check the links in the path";
  return "";
}

}  // namespace torquer
