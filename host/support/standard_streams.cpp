#include "host/support/standard_streams.h"

#include <fmt/format.h>
#include <poll.h>
#include <unistd.h>

#include <array>
#include <cerrno>
#include <csignal>
#include <cstring>
#include <utility>

#include "host/support/error.h"

namespace torquer {
namespace {

constexpr std::size_t kMostBytes = 1'000'000;
// Longest time for which a signal just before the wait stays unnoticed.
constexpr int kLookAgainMs = 200;

}  // namespace

StandardStreams::StandardStreams(const std::atomic<bool>& stop, bool answers)
    : stop_(stop), answers_(answers) {
  if (answers_) std::signal(SIGPIPE, SIG_IGN);
}

// True if there is something to read or the input has ended.
bool StandardStreams::WaitForInput() {
  // poll ignores a negative descriptor.
  std::array<pollfd, 2> ends = {{{STDIN_FILENO, POLLIN, 0}, {answers_ ? STDOUT_FILENO : -1, 0, 0}}};
  while (!stop_) {
    if (poll(ends.data(), ends.size(), kLookAgainMs) <= 0) continue;
    if (ends[0].revents != 0) return true;
    reader_gone_ = true;
    return false;
  }
  return false;
}

std::optional<std::string> StandardStreams::NextLine() {
  std::array<char, 65536> bytes{};
  for (std::size_t searched = 0;;) {
    const std::size_t end = received_.find('\n', searched);
    if (end != std::string::npos) {
      std::string line = received_.substr(0, end);
      received_.erase(0, end + 1);
      return line;
    }
    searched = received_.size();
    if (searched > kMostBytes) {
      throw UserError(
          fmt::format("standard input: a line has more than {} bytes; end each row with a new line",
                      kMostBytes));
    }
    if (ended_) {
      if (received_.empty()) return std::nullopt;
      return std::exchange(received_, "");
    }
    if (!WaitForInput()) return std::nullopt;
    const ssize_t got = read(STDIN_FILENO, bytes.data(), bytes.size());
    if (got > 0) received_.append(bytes.data(), static_cast<std::size_t>(got));
    if (got == 0) ended_ = true;
    if (got < 0 && errno != EINTR && errno != EAGAIN) {
      throw UserError(fmt::format("standard input: cannot be read: {}; send rows through a pipe",
                                  std::strerror(errno)));
    }
  }
}

bool StandardStreams::Write(std::string_view text) {
  while (!text.empty()) {
    const ssize_t written = write(STDOUT_FILENO, text.data(), text.size());
    if (written >= 0) {
      text.remove_prefix(static_cast<std::size_t>(written));
    } else if (errno == EAGAIN) {
      if (stop_) return false;
      pollfd room = {STDOUT_FILENO, POLLOUT, 0};
      poll(&room, 1, kLookAgainMs);
    } else if (errno == EPIPE) {
      reader_gone_ = true;
      return false;
    } else if (errno == EINTR) {
      if (stop_) return false;
    } else {
      throw UserError(fmt::format("standard output: cannot be written: {}; is the disk full?",
                                  std::strerror(errno)));
    }
  }
  return true;
}

}  // namespace torquer
