#include "host/tools/calibrate_terminal.h"

#include <poll.h>
#include <sys/ioctl.h>
#include <unistd.h>

#include <algorithm>
#include <cstdio>

namespace torquer::tools {

Terminal::Terminal() {
  screen_ = isatty(STDOUT_FILENO) != 0;
  winsize size{};
  if (screen_ && ioctl(STDOUT_FILENO, TIOCGWINSZ, &size) == 0 && size.ws_col > 0) {
    columns_ = std::max<int>(size.ws_col, 20);
  }
  keys_ = isatty(STDIN_FILENO) != 0 && tcgetattr(STDIN_FILENO, &before_) == 0;
  if (!keys_) return;
  termios keys = before_;
  keys.c_lflag &= ~static_cast<tcflag_t>(ICANON | ECHO);  // Ctrl-C stays a signal
  tcsetattr(STDIN_FILENO, TCSANOW, &keys);
}

Terminal::~Terminal() {
  Change("");
  if (keys_) tcsetattr(STDIN_FILENO, TCSANOW, &before_);
}

std::optional<char> Terminal::Key() {
  pollfd event{STDIN_FILENO, POLLIN, 0};
  if (ended_ || poll(&event, 1, 0) <= 0) return std::nullopt;
  char key = 0;
  const ssize_t size = read(STDIN_FILENO, &key, 1);
  if (size == 0) ended_ = true;
  if (size != 1) return std::nullopt;
  return key == '\r' ? '\n' : key;
}

void Terminal::Print(const std::string& line) {
  if (screen_) std::printf("\r\033[K");
  std::printf("%s\n", line.c_str());
  if (screen_) std::printf("%s", changing_.c_str());
  std::fflush(stdout);
}

void Terminal::Change(const std::string& line) {
  if (!screen_) return;
  // Truncated, because a wrapped line cannot be overwritten.
  changing_ = line.substr(0, static_cast<std::size_t>(columns_ - 1));
  std::printf("\r\033[K%s", changing_.c_str());
  std::fflush(stdout);
}

std::string Ask(const std::string& question) {
  std::printf("%s ", question.c_str());
  std::fflush(stdout);
  std::string answer;
  for (int character = std::getchar(); character != EOF && character != '\n';
       character = std::getchar()) {
    answer += static_cast<char>(character);
  }
  return answer;
}

bool CanAsk() { return isatty(STDIN_FILENO) != 0 && isatty(STDOUT_FILENO) != 0; }

}  // namespace torquer::tools
