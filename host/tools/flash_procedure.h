// How firmware is installed on a board: find the board, check the image, enter the bootloader,
// write, verify, commit, and read the self-test of the new firmware. It can start in any state of
// the board.
#pragma once

#include <functional>
#include <optional>
#include <string>

#include "host/support/error.h"
#include "host/tools/flash_board.h"
#include "host/tools/flash_image.h"
#include "protocol/bootloader_reports.h"
#include "protocol/hid_reports.h"

namespace torquer::tools {

struct FlashRequest {
  std::string image;         ///< file; empty: the one in `image_folder` for the board's clock
  std::string image_folder;  ///< with the images of the build
  std::string device;        ///< serial number; empty: the only board there is
  /// Serial port of a board in Caterina, or of one with an Arduino program that may be overwritten;
  /// empty: find a board.
  std::string port;
  bool force = false;    ///< an older version may replace a newer one
  bool dry_run = false;  ///< report what would be done, and do nothing
};

/// What the procedure calls.
struct FlashHooks {
  /// A line for the user.
  std::function<void(const std::string& line)> say = [](const std::string&) {};
  /// `done` of `total` steps of `what` are done.
  std::function<void(const std::string& what, int done, int total)> progress =
      [](const std::string&, int, int) {};
  /// Whether the user wants to stop.
  std::function<bool()> stop = [] { return false; };
  /// Writes the image by the Caterina at a serial port; throws FlashUnfinished.
  std::function<void(const std::string& port, const FlashImage& image)> flash_caterina;
  /// Asks the Arduino program at a serial port to start its bootloader; throws UserError.
  std::function<void(const std::string& port)> ask_sketch;
};

/// Something was begun and is not finished. what() names the state of the board and the remedy.
class FlashUnfinished : public std::runtime_error {
 public:
  using std::runtime_error::runtime_error;
};

/// What the new firmware reports about itself.
struct FlashOutcome {
  FirmwareVersion version;
  std::string serial;
  bool application_good = false;
  bool settings_good = false;
  bool sensor_good = false;
};

class FlashProcedure {
 public:
  FlashProcedure(Boards& boards, FlashRequest request, FlashHooks hooks);

  /// Nothing after a dry run. Throws UserError if nothing was changed, otherwise FlashUnfinished;
  /// run again, it continues from there.
  std::optional<FlashOutcome> Run();

  /// Loads the sensor maker's image in the file `path` into the sensor of the board, which must run
  /// our firmware, and keeps a copy for the daemon (device/sensor_firmware.h); returns the number
  /// that the sensor then runs, 0 after a dry run. Throws
  /// UserError naming file or board and the remedy; the sensor then runs without an image.
  int LoadSensorImage(const std::string& path);

 private:
  struct Found {
    Board board;
    std::string serial;
    int clock_mhz = 0;
    std::optional<FirmwareVersion> installed;  // of a valid application
    std::string state;                         // for the user
  };

  Found Find();
  Board Choose();
  Found Examine(const Board& board);
  Found ExamineFirmware(const Board& board);
  Found ExamineBootloader(const Board& board);
  FlashImage LoadImage(const Found& found) const;
  void CheckFits(const Found& found, const FlashImage& image) const;
  Board EnterBootloader(const Found& found);
  Board AskSketch(const Found& found);
  void WriteByBootloader(const Board& board, const FlashImage& image);
  FlashOutcome ReadSelfTest(const Found& before, const FlashImage& image);
  std::optional<Board> WaitFor(const Found& before, int milliseconds, bool firmware);
  bool IsSame(const Board& board, const Found& before);
  void StopIfWanted(const std::string& state) const;

  Boards& boards_;
  FlashRequest request_;
  FlashHooks hooks_;
};

}  // namespace torquer::tools
