#include "tests/flash/caterina_responder.h"

#include <fcntl.h>
#include <poll.h>
#include <stdlib.h>
#include <termios.h>
#include <unistd.h>

#include <stdexcept>

namespace torquer::test {
namespace {

constexpr std::uint8_t kAck = '\r';

}  // namespace

CaterinaResponder::CaterinaResponder() : flash_(kFlashBytes, 0xff) {
  controller_ = posix_openpt(O_RDWR | O_NOCTTY | O_CLOEXEC);
  if (controller_ < 0 || grantpt(controller_) != 0 || unlockpt(controller_) != 0) {
    throw std::runtime_error("no pseudo-terminal to be had");
  }
  char name[64];
  if (ptsname_r(controller_, name, sizeof(name)) != 0) throw std::runtime_error("ptsname_r");
  port_ = name;
  keep_open_ = open(name, O_RDWR | O_NOCTTY | O_CLOEXEC);
  termios settings{};
  tcgetattr(keep_open_, &settings);
  cfmakeraw(&settings);
  tcsetattr(keep_open_, TCSANOW, &settings);
  thread_ = std::thread([this] { Run(); });
}

CaterinaResponder::~CaterinaResponder() {
  stop_ = true;
  thread_.join();
  close(keep_open_);
  close(controller_);
}

std::vector<std::uint8_t> CaterinaResponder::flash() const {
  const std::lock_guard lock(mutex_);
  return flash_;
}

std::vector<std::string> CaterinaResponder::log() const {
  const std::lock_guard lock(mutex_);
  return log_;
}

void CaterinaResponder::Log(const std::string& what) {
  const std::lock_guard lock(mutex_);
  log_.push_back(what);
}

void CaterinaResponder::Run() {
  std::uint8_t command = 0;
  while (ReadByte(&command)) {
    if (silent_after_ >= 0 && writes_ >= silent_after_) continue;
    Obey(command);
  }
}

// False once the test is over.
bool CaterinaResponder::ReadByte(std::uint8_t* byte) {
  while (!stop_) {
    pollfd wait{controller_, POLLIN, 0};
    if (poll(&wait, 1, 20) > 0 && read(controller_, byte, 1) == 1) return true;
  }
  return false;
}

void CaterinaResponder::Answer(const std::vector<std::uint8_t>& bytes) {
  std::size_t sent = 0;
  while (sent < bytes.size() && !stop_) {
    const ssize_t count = write(controller_, bytes.data() + sent, bytes.size() - sent);
    if (count > 0) sent += static_cast<std::size_t>(count);
  }
}

void CaterinaResponder::Obey(std::uint8_t command) {
  std::uint8_t high = 0, low = 0;
  switch (command) {
    case 'S':
      return Answer({'C', 'A', 'T', 'E', 'R', 'I', 'N'});
    case 'V':
      return Answer({'1', '0'});
    case 'v':
    case 'h':
      return Answer({'?'});
    case 'p':
      return Answer({'S'});
    case 'a':
      return Answer({'Y'});
    case 'b':  // blocks of a page
      return Answer({'Y', 0, kPageBytes});
    case 't':
      return Answer({0x44, 0});
    case 'T':
    case 'x':
    case 'y':
      ReadByte(&low);
      return Answer({kAck});
    case 'P':
    case 'L':
      return Answer({kAck});
    case 'E':
      Log("exit");
      return Answer({kAck});
    case 's':
      return Answer({0x87, 0x95, 0x1e});
    case 'F':
      return Answer({0xff});
    case 'N':
      return Answer({0xd8});
    case 'Q':
      return Answer({0xcb});
    case 'r':
      return Answer({0x2f});
    case 'A':
      ReadByte(&high);
      ReadByte(&low);
      address_ = high << 8 | low;
      return Answer({kAck});
    case 'e': {
      Log("erase");
      {
        const std::lock_guard lock(mutex_);
        flash_.assign(kFlashBytes, 0xff);
      }
      return Answer({kAck});
    }
    case 'B':
      return Block(true);
    case 'g':
      return Block(false);
    default:
      return Answer({'?'});
  }
}

void CaterinaResponder::Block(bool write) {
  std::uint8_t high = 0, low = 0, memory = 0;
  ReadByte(&high);
  ReadByte(&low);
  ReadByte(&memory);
  const int size = high << 8 | low;
  const int from = address_ * 2;
  if (memory != 'F' || from + size > kFlashBytes) return Answer({'?'});
  const std::string page = std::to_string(from / kPageBytes);
  if (write) {
    std::vector<std::uint8_t> bytes(static_cast<std::size_t>(size));
    for (std::uint8_t& byte : bytes) ReadByte(&byte);
    ++writes_;
    Log("write " + page);
    if (from / kPageBytes == spoiled_page_) bytes[5] ^= 4;
    const std::lock_guard lock(mutex_);
    // Programming can clear bits, but not set them.
    for (std::size_t i = 0; i < bytes.size(); ++i) {
      flash_[static_cast<std::size_t>(from) + i] &= bytes[i];
    }
  }
  address_ += size / 2;
  if (write) return Answer({kAck});
  Log("read " + page);
  std::vector<std::uint8_t> bytes;
  {
    const std::lock_guard lock(mutex_);
    bytes.assign(flash_.begin() + from, flash_.begin() + from + size);
  }
  Answer(bytes);
}

}  // namespace torquer::test
