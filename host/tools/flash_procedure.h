// Flash procedure: installs firmware on a board. Its steps: find the board, check the image, enter
// the bootloader, write, verify, commit. At last it reads the self-test of the new firmware. It can
// start in any state of the board.
#pragma once

#include <cstdint>
#include <functional>
#include <optional>
#include <string>

#include "host/support/error.h"
#include "host/tools/board_search.h"
#include "host/tools/flash_board.h"
#include "host/tools/flash_image.h"

namespace torquer::tools {

struct FlashRequest {
  std::string image;         ///< image file; empty: the one in `image_folder` for board and clock
  std::string image_folder;  ///< folder with the images of the build
  std::string device;        ///< serial number; empty: the only connected board
  /// Serial port of a board in Caterina, or with an Arduino program that may be overwritten; empty:
  /// find a board.
  std::string port;
  bool force = false;    ///< allow an older version to replace a newer one
  bool dry_run = false;  ///< report the planned actions without executing them
};

/// Callbacks of the procedure.
struct FlashHooks {
  /// Prints a line for the user.
  std::function<void(const std::string& line)> say = [](const std::string&) {};
  /// Reports progress: `done` of `total` steps of `what` are done.
  std::function<void(const std::string& what, int done, int total)> progress =
      [](const std::string&, int, int) {};
  /// Returns true if the user wants to stop.
  std::function<bool()> stop = [] { return false; };
  /// Writes the image through Caterina at a serial port; throws FlashUnfinished.
  std::function<void(const std::string& port, const FlashImage& image)> flash_caterina;
  /// Asks the Arduino program at a serial port to start its bootloader; throws UserError.
  std::function<void(const std::string& port)> ask_sketch;
};

/// Error: the update was started but not finished. what() names the state of the board and the
/// remedy.
class FlashUnfinished : public std::runtime_error {
 public:
  using std::runtime_error::runtime_error;
};

/// Identity and self-test of the new firmware.
struct FlashOutcome {
  FirmwareVersion version;
  std::string serial;
  bool application_good = false;
  bool settings_good = false;
  bool sensor_good = false;
  std::optional<bool> second_sensor_good;  ///< none on a board with one sensor
  std::string supply_warning;  ///< a supply too low for the CPU's clock, with the remedy; or empty
};

class FlashProcedure {
 public:
  FlashProcedure(Boards& boards, FlashRequest request, FlashHooks hooks);

  /// Runs the procedure; returns nullopt after a dry run. On failure it throws UserError if the
  /// board is unchanged, otherwise FlashUnfinished. Another run continues from there.
  std::optional<FlashOutcome> Run();

  /// Loads the sensor vendor's image from the file `path` into the board's sensor. Keeps a copy for
  /// the daemon (device/sensor_firmware.h). The board must run our firmware. Returns the image
  /// number that the sensor then runs, 0 after a dry run. Throws UserError with the file or board
  /// and the remedy; the sensor then runs without an image.
  int LoadSensorImage(const std::string& path);

  /// Sets the contacts that are closed at rest (protocol::Button bits), such as a sustain pedal.
  /// The board keeps them; it must run our firmware. A dry run does not change the board. Throws
  /// UserError with the board and the remedy.
  void SetClosedAtRest(std::uint8_t buttons);

 private:
  FoundBoard FindFirmware(const std::string& task);
  FlashImage LoadImage(const FoundBoard& found) const;
  void CheckFits(const FoundBoard& found, const FlashImage& image) const;
  Board EnterBootloader(const FoundBoard& found);
  Board AskSketch(const FoundBoard& found);
  void WriteByBootloader(const Board& board, const FlashImage& image);
  std::string JudgeSupply(const Board& board, const FlashImage& image);
  FlashOutcome ReadSelfTest(const FoundBoard& before, const FlashImage& image);
  std::optional<Board> WaitFor(const FoundBoard& before, int milliseconds, bool firmware);
  bool IsSame(const Board& board, const FoundBoard& before);
  void StopIfWanted(const std::string& state) const;

  Boards& boards_;
  FlashRequest request_;
  FlashHooks hooks_;
  BoardSearch search_;
};

}  // namespace torquer::tools
