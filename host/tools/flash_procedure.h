// How firmware comes onto a board: find it, judge the image, enter the bootloader, write, verify,
// commit, and hear from the new firmware. It can be begun in whatever state the board is.
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
  std::string image_folder;  ///< where the build leaves its images
  std::string device;        ///< serial number; empty: the only board there is
  std::string port;          ///< serial port of a board in Caterina; empty: find it
  bool force = false;        ///< an older version may replace a newer one
  bool dry_run = false;      ///< say what would be done, and do nothing
};

/// What the procedure needs and tells on its way.
struct FlashHooks {
  /// A line for the user.
  std::function<void(const std::string& line)> say = [](const std::string&) {};
  /// `done` of `total` steps of what is going on.
  std::function<void(const std::string& what, int done, int total)> progress =
      [](const std::string&, int, int) {};
  /// Whether the user wants to stop.
  std::function<bool()> stop = [] { return false; };
  /// Writes the image by the Caterina at a serial port; throws FlashUnfinished.
  std::function<void(const std::string& port, const FlashImage& image)> flash_caterina;
};

/// Something was begun and is not done. what() tells the state of the board and what to do.
class FlashUnfinished : public std::runtime_error {
 public:
  using std::runtime_error::runtime_error;
};

/// What the new firmware says of itself.
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

  /// Nothing is returned after a dry run. Throws UserError if nothing was changed, and
  /// FlashUnfinished otherwise; run again, it goes on from there.
  std::optional<FlashOutcome> Run();

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
  void Judge(const Found& found, const FlashImage& image) const;
  Board EnterBootloader(const Found& found);
  void WriteByBootloader(const Board& board, const FlashImage& image);
  FlashOutcome HearFirmware(const Found& before, const FlashImage& image);
  std::optional<Board> WaitFor(const Found& before, int milliseconds, bool firmware);
  bool IsSame(const Board& board, const Found& before);
  void StopIfWanted(const std::string& state) const;

  Boards& boards_;
  FlashRequest request_;
  FlashHooks hooks_;
};

}  // namespace torquer::tools
