// USB boards: boards on this machine's USB, through libusb.
#pragma once

#include "host/tools/flash_board.h"

namespace torquer::tools {

class UsbBoards final : public Boards {
 public:
  /// Throws UserError if the USB cannot be used at all, as does Open().
  std::vector<Board> List() override;
  std::unique_ptr<FeatureLink> Open(const Board& board) override;
  void Sleep(int milliseconds) override;
};

}  // namespace torquer::tools
