// Reports of the bench device by the kernel's HID driver (hidraw), through hidapi. Use it if libusb
// cannot take the device, because another program or the system needs the kernel's driver. Reports
// and features are the same as in usb_source.h. The kernel polls, and keeps the newest 64 reports.
#pragma once

#include <hidapi.h>

#include <atomic>
#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "host/device/reopening.h"
#include "host/device/report_source.h"

namespace torquer::device {

class HidrawSource : public ReportSource {
 public:
  /// Reads the device with this serial number; "" for the only one there is. After a connection,
  /// only the device with that serial number is read. A process has at most one such object. Throws
  /// UserError if hidapi cannot be used.
  explicit HidrawSource(std::string serial);
  ~HidrawSource() override;
  HidrawSource(const HidrawSource&) = delete;
  HidrawSource& operator=(const HidrawSource&) = delete;

  /// Before the first connection it throws UserError for several devices without a choice. It also
  /// throws for a device that may not be opened.
  void Wait(int timeout_ms, const Sink& sink) override;
  void LetGo(const std::string& reason) override;
  void Interrupt() override { interrupted_ = true; }
  std::vector<std::uint8_t> GetFeature(std::uint8_t report_id) override;
  void SetFeature(std::span<const std::uint8_t> report) override;
  std::string place() const override;

 private:
  struct Found {
    std::string path;
    std::string serial;
  };

  std::optional<Found> Look();
  bool Open();
  bool Read(int timeout_ms, const Sink& sink);
  int Checked(int result);

  std::string serial_;
  std::atomic<bool> interrupted_ = false;
  hid_device* device_ = nullptr;  // being read
  std::string path_;
  std::string gone_;  // why, once the device is
  Reopening reopening_;
  std::int64_t looked_us_ = 0;     // when one was looked for last
  std::int64_t forbidden_us_ = 0;  // first time at which a device could not be opened; 0: none
  bool bootloader_seen_ = false;
};

}  // namespace torquer::device
