// Search for the board that is to be flashed.
#pragma once

#include <optional>
#include <string>

#include "host/tools/flash_board.h"
#include "host/tools/flash_image.h"

namespace torquer::tools {

struct FoundBoard {
  Board board;
  std::string serial;
  int image_board = 0;                       ///< protocol::ImageBoard; 0: unknown
  int crystal_mhz = 0;                       ///< 0: unknown
  int cpu_mhz = 0;                           ///< 0: unknown
  std::optional<FirmwareVersion> installed;  ///< version of a valid application
  std::string state;                         ///< description for the user
};

class BoardSearch {
 public:
  /// `device`: serial number; empty: the only connected board. `port`: serial port of a board in
  /// Caterina or with an Arduino program; empty: find a board.
  BoardSearch(Boards& boards, std::string device, std::string port);

  /// Throws UserError with the reason and the remedy.
  FoundBoard Find();

 private:
  Board Choose();
  FoundBoard Examine(const Board& board);
  FoundBoard ExamineFirmware(const Board& board);
  FoundBoard ExamineBootloader(const Board& board);

  Boards& boards_;
  std::string device_;
  std::string port_;
};

}  // namespace torquer::tools
