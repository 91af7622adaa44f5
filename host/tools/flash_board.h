// Board interface of torquer-flash: boards on the USB, and feature reports of Torquer's boards. It
// is implemented with libusb, and in tests with the emulator.
#pragma once

#include <memory>
#include <stdexcept>
#include <string>
#include <vector>

#include "host/device/feature_reports.h"

namespace torquer::tools {

/// Program that runs on a board.
enum class BoardMode {
  kFirmware,    ///< our firmware
  kBootloader,  ///< our bootloader
  kCaterina,    ///< the bootloader of Arduino boards, for 8 s after a reset
  kSketch,      ///< an Arduino program, on a board with Caterina
  kDfu          ///< the chip's factory bootloader
};

struct Board {
  BoardMode mode = BoardMode::kFirmware;
  std::string place;    ///< USB port, such as "1-2.3"; the same in every mode
  std::string serial;   ///< serial number with our firmware; else empty
  std::string port;     ///< serial port with Caterina or an Arduino program; empty: none yet
  int crystal_mhz = 0;  ///< from its USB ids; 0: unknown
  std::string problem;  ///< reason why it is unusable, with the remedy; empty if usable
};

/// Error: the board was disconnected.
class BoardLost : public std::runtime_error {
 public:
  using std::runtime_error::runtime_error;
};

using device::ReportRefused;
/// Feature reports of one board. Both functions throw BoardLost or ReportRefused.
using FeatureLink = device::FeatureReports;

class Boards {
 public:
  Boards() = default;
  Boards(const Boards&) = delete;
  Boards& operator=(const Boards&) = delete;
  virtual ~Boards() = default;

  virtual std::vector<Board> List() = 0;
  /// Opens a board with our firmware or bootloader. Throws BoardLost; UserError with the remedy if
  /// access is denied. While a link is open, no other program can use the board.
  virtual std::unique_ptr<FeatureLink> Open(const Board& board) = 0;
  /// Waits.
  virtual void Sleep(int milliseconds) = 0;
};

}  // namespace torquer::tools
