// Reports of the bench device over USB, by libusb: several interrupt transfers in flight, hotplug,
// and every way in which a device can fail or be removed.
#pragma once

#include <libusb.h>

#include <array>
#include <cstdint>
#include <deque>
#include <memory>
#include <string>
#include <vector>

#include "host/device/report_source.h"
#include "protocol/hid_reports.h"

namespace torquer::device {

class UsbSource : public ReportSource {
 public:
  /// Reads the device with this serial number; "" for the only one there is. Once connected, only
  /// the device with that serial number is read. Throws UserError when the USB cannot be used.
  explicit UsbSource(std::string serial);
  ~UsbSource() override;
  UsbSource(const UsbSource&) = delete;
  UsbSource& operator=(const UsbSource&) = delete;

  /// Also throws UserError when there are several devices and none was chosen, when the device may
  /// not be opened, when another program uses it, or when its endpoints are not those of our
  /// firmware.
  void Wait(int timeout_ms, const Sink& sink) override;
  void Interrupt() override;
  std::vector<std::uint8_t> GetFeature(std::uint8_t report_id) override;
  void SetFeature(std::span<const std::uint8_t> report) override;
  std::string place() const override;

 private:
  static constexpr int kTransfers = 4;

  struct Transfer {
    UsbSource* source = nullptr;
    libusb_transfer* transfer = nullptr;
    bool in_flight = false;
    std::array<std::uint8_t, sizeof(protocol::InputReport)> bytes{};
  };
  struct Arrival {
    std::int64_t host_us;
    int size;
    std::array<std::uint8_t, sizeof(protocol::InputReport)> bytes;
  };
  struct Candidate {
    libusb_device* device;
    std::int64_t seen_us;
    bool left;  // unplugged again
  };
  struct OpenDevice {
    libusb_device_handle* handle;
    std::string serial;
    std::string address;
  };

  static int LIBUSB_CALL OnHotplug(libusb_context* context, libusb_device* device,
                                   libusb_hotplug_event event, void* self);
  static void LIBUSB_CALL OnTransfer(libusb_transfer* transfer);

  void TakeCandidates(const Sink& sink);
  bool TryOpen(const Candidate& candidate, std::vector<OpenDevice>& found);
  void Start(const OpenDevice& device);
  void CheckEndpoint(const OpenDevice& device) const;
  void Submit(Transfer& transfer);
  void Revive();
  void Stop();
  void Deliver(const Sink& sink);
  int Control(std::uint8_t direction, std::uint8_t request, std::uint8_t report_id,
              std::span<std::uint8_t> bytes);

  std::string serial_;
  libusb_context* context_ = nullptr;
  libusb_hotplug_callback_handle hotplug_{};
  std::deque<Candidate> candidates_;
  bool bootloader_seen_ = false;

  libusb_device_handle* handle_ = nullptr;  // of the device being read
  std::string address_;
  std::vector<std::unique_ptr<Transfer>> transfers_;
  std::vector<Arrival> arrivals_;
  std::string gone_;  // why, once the device is
  bool stalled_ = false;
  int errors_in_a_row_ = 0;
};

}  // namespace torquer::device
