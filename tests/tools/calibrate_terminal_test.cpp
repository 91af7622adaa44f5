// torquer-calibrate with a user at a terminal: questions, keys, the changing line, Ctrl-C.
#include <poll.h>
#include <pty.h>
#include <sys/wait.h>
#include <termios.h>
#include <unistd.h>

#include <algorithm>
#include <catch2/catch.hpp>
#include <chrono>
#include <csignal>
#include <filesystem>

#include "tests/support/paths.h"
#include "tests/support/reports.h"
#include "tests/support/socket_device.h"
#include "tests/support/temporary_folder.h"

namespace {

using torquer::protocol::InputReport;
using torquer::test::Next;
using torquer::test::SocketDevice;
using torquer::test::StillReport;
using torquer::test::TemporaryFolder;

constexpr auto kPatience = std::chrono::seconds(120);

// A program in its own terminal, and the device that it reads.
class Desk {
 public:
  Desk() : device_(folder.Path("socket")) {
    const std::string program = torquer::test::ProgramPath("torquer-calibrate");
    const std::string socket = folder.Path("socket");
    const std::string output = folder.Path("calibration.toml");
    winsize size{};
    size.ws_col = 100;
    size.ws_row = 30;
    pid_ = forkpty(&terminal_, nullptr, nullptr, &size);
    if (pid_ == 0) {
      execl(program.c_str(), program.c_str(), "--source", "socket", "--socket", socket.c_str(),
            "--output", output.c_str(), nullptr);
      _exit(127);
    }
    REQUIRE(pid_ > 0);
  }
  ~Desk() {
    if (pid_ > 0) {
      kill(pid_, SIGKILL);
      waitpid(pid_, nullptr, 0);
    }
    close(terminal_);
  }
  Desk(const Desk&) = delete;
  Desk& operator=(const Desk&) = delete;

  void Type(const std::string& keys) {
    REQUIRE(write(terminal_, keys.data(), keys.size()) == static_cast<ssize_t>(keys.size()));
  }
  // True once `text` is shown after the text found last; the device keeps running.
  bool Shows(const std::string& text) {
    const auto deadline = std::chrono::steady_clock::now() + kPatience;
    while (std::chrono::steady_clock::now() < deadline) {
      const std::size_t found = shown.find(text, looked_);
      if (found != std::string::npos) {
        looked_ = found + text.size();
        return true;
      }
      Follow();
    }
    UNSCOPED_INFO("shown: " << shown);
    return false;
  }
  // Exit status; -1 on timeout.
  int End() {
    const auto deadline = std::chrono::steady_clock::now() + kPatience;
    int status = 0;
    while (waitpid(pid_, &status, WNOHANG) == 0) {
      if (std::chrono::steady_clock::now() > deadline) return -1;
      Follow();
    }
    pid_ = -1;
    while (Follow()) {
    }
    return WIFEXITED(status) ? WEXITSTATUS(status) : 128 + WTERMSIG(status);
  }
  // True if line mode and echo are on, as before the program.
  bool IsAsBefore() const {
    termios now{};
    return tcgetattr(terminal_, &now) == 0 && (now.c_lflag & ICANON) != 0 &&
           (now.c_lflag & ECHO) != 0;
  }
  void Push(int counts) { left_ += counts; }

  TemporaryFolder folder;
  std::string shown;

 private:
  // Reads the terminal's output and lets the device report; false if there was no output.
  bool Follow() {
    if (pid_ > 0 && connected_) {
      for (int i = 0; i < 20; ++i) {
        device_.Send(report_);
        report_ = Next(report_);
        const int step = std::min(left_, 500);
        report_.axial_counts += step;
        left_ -= step;
      }
    }
    pollfd event{terminal_, POLLIN, 0};
    if (poll(&event, 1, 2) <= 0) return false;
    char text[4096];
    const ssize_t size = read(terminal_, text, sizeof text);
    if (size <= 0) return false;
    shown.append(text, static_cast<std::size_t>(size));
    if (!connected_ && shown.find("Standard deviation of that distance") != std::string::npos &&
        shown.ends_with("\n")) {
      connected_ = device_.WaitForHost();
    }
    return true;
  }

  SocketDevice device_;
  InputReport report_ = StillReport();
  int left_ = 0;  // counts still to be pushed
  bool connected_ = false;
  int terminal_ = -1;
  pid_t pid_ = -1;
  std::size_t looked_ = 0;
};

}  // namespace

TEST_CASE("A person gets questions, instructions and live numbers, and can stop by Ctrl-C") {
  Desk desk;
  REQUIRE(desk.Shows("Distance from the near stop to the far stop, mm [150]:"));
  desk.Type("far\n");
  REQUIRE(desk.Shows("'far' is not a number."));
  desk.Type("149.5\n");
  REQUIRE(desk.Shows("Standard deviation of that distance, mm [0.5]:"));
  desk.Type("\n");
  REQUIRE(desk.Shows("Device SCRIPTED-1 at 1200 cpi"));
  REQUIRE(desk.Shows("Rest: Hands off"));
  REQUIRE(desk.Shows("ok at rest it drifts by 0.0 counts a second"));
  REQUIRE(desk.Shows("Pushes 0/6: Pull it back to the near stop"));
  desk.Type("\n");
  REQUIRE(desk.Shows("Push it straight to the far stop, 149.5 mm"));
  desk.Push(3543);
  REQUIRE(desk.Shows("+74.99 mm"));
  REQUIRE(desk.Shows("counts 3543 axial, 0 transverse | quality 60"));
  CHECK_FALSE(desk.IsAsBefore());
  desk.Type("u");
  REQUIRE(desk.Shows("there is no stroke to undo"));
  SECTION("by Ctrl-C") { desk.Type("\x03"); }
  SECTION("by q") { desk.Type("q"); }
  CHECK(desk.End() == 130);
  CHECK(desk.Shows("Stopped; nothing was written."));
  CHECK(desk.IsAsBefore());
  CHECK_FALSE(std::filesystem::exists(desk.folder.Path("calibration.toml")));
}
