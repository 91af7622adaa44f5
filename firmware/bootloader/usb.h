// The bootloader's side of the USB: endpoint 0, polled, with the feature reports of
// protocol/bootloader_reports.h.
#pragma once

#include <stdint.h>

#include "protocol/bootloader_reports.h"

namespace torquer {
namespace bootloader {

/// All of its state is on the stack of main(), so that no variable of the application changes.
class UsbServer {
 public:
  /// Attaches to the bus. `application_valid`: result of the check at the start.
  explicit UsbServer(bool application_valid);

  /// Serves the host until it asks for a restart, and leaves the bus.
  void Run();

 private:
  struct __attribute__((packed)) Setup {
    uint8_t type;
    uint8_t request;
    uint16_t value;
    uint16_t index;
    uint16_t length;
  };

  bool Serve();
  bool SendDescriptor();
  bool SendReport();
  bool TakeReport();
  bool Execute();
  void Send(const uint8_t* data, uint8_t size, bool in_flash);

  Setup setup_;
  uint16_t selected_page_ = 0;
  uint8_t configuration_ = 0;
  bool application_valid_;
  bool trailer_erased_ = false;
  bool restart_wanted_ = false;
  union {
    uint8_t bytes[sizeof(protocol::PageReport)];
    protocol::BootloaderStatusReport status;
    protocol::PageReport page;
    protocol::BootloaderCommandReport command;
  } report_;
};

}  // namespace bootloader
}  // namespace torquer
