// Boards that torquer-flash may find, and the reports that it exchanges with those that are ours:
// an interface to libusb, and in tests to the emulator.
#pragma once

#include <memory>
#include <stdexcept>
#include <string>
#include <vector>

#include "host/device/feature_reports.h"

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
  std::string place;    ///< where it is plugged in, as "1-2.3"; the same in every mode
  std::string serial;   ///< with our firmware; else empty
  std::string port;     ///< with Caterina or an Arduino program: its serial port; empty: none yet
  int clock_mhz = 0;    ///< if its USB ids say so; 0: unknown
  std::string problem;  ///< why it cannot be used, with the remedy; empty if it can
};

/// The board is gone.
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
  /// Opens a board with our firmware or bootloader. Throws BoardLost; UserError naming the remedy
  /// if it may not be used. While a link is open nobody else can use the board.
  virtual std::unique_ptr<FeatureLink> Open(const Board& board) = 0;
  /// Lets time pass.
  virtual void Sleep(int milliseconds) = 0;
};

}  // namespace torquer::tools
