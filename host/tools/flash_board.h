// Boards that torquer-flash may find, and how it speaks with those that are ours: what the
// procedure asks of whatever they are plugged into (libusb; in tests the emulator).
#pragma once

#include <cstdint>
#include <memory>
#include <span>
#include <stdexcept>
#include <string>
#include <vector>

namespace torquer::tools {

/// What runs on a board.
enum class BoardMode {
  kFirmware,    ///< our firmware
  kBootloader,  ///< our bootloader
  kCaterina,    ///< the bootloader of Arduino boards, for 8 s after a reset
  kSketch,      ///< an Arduino program, on a board with Caterina
  kDfu          ///< the bootloader that the chip's factory installs
};

struct Board {
  BoardMode mode = BoardMode::kFirmware;
  std::string place;    ///< where it is plugged in, as "1-2.3"; stays from mode to mode
  std::string serial;   ///< of our firmware; else empty
  std::string port;     ///< of Caterina: its serial port; empty if there is none yet
  int clock_mhz = 0;    ///< as far as its ids tell; 0: unknown
  std::string trouble;  ///< why it cannot be used, with the remedy; empty if it can
};

/// The board is not there any more.
class BoardLost : public std::runtime_error {
 public:
  using std::runtime_error::runtime_error;
};

/// The board refused a report.
class ReportRefused : public std::runtime_error {
 public:
  using std::runtime_error::runtime_error;
};

/// Feature reports of one board. Both throw BoardLost or ReportRefused.
class FeatureLink {
 public:
  FeatureLink() = default;
  FeatureLink(const FeatureLink&) = delete;
  FeatureLink& operator=(const FeatureLink&) = delete;
  virtual ~FeatureLink() = default;

  /// `size` bytes, report id first.
  virtual std::vector<std::uint8_t> Get(std::uint8_t report_id, std::size_t size) = 0;
  virtual void Set(std::span<const std::uint8_t> report) = 0;
};

class Boards {
 public:
  Boards() = default;
  Boards(const Boards&) = delete;
  Boards& operator=(const Boards&) = delete;
  virtual ~Boards() = default;

  virtual std::vector<Board> List() = 0;
  /// A board in our firmware or bootloader. Throws BoardLost; UserError naming the remedy if it may
  /// not be used. While a link is open nobody else can use the board.
  virtual std::unique_ptr<FeatureLink> Open(const Board& board) = 0;
  /// Lets time pass.
  virtual void Sleep(int milliseconds) = 0;
};

}  // namespace torquer::tools
