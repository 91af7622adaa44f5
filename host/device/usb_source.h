// Reports of the bench device over USB, by libusb, with several interrupt transfers in flight.
// Handles hotplug, and recovers from each failure or removal of a device.
#pragma once

#include <libusb.h>

#include <array>
#include <cstdint>
#include <deque>
#include <memory>
#include <string>
#include <vector>

#include "host/device/reopening.h"
#include "host/device/report_source.h"
#include "protocol/hid_reports.h"

namespace torquer::device {

class UsbSource : public ReportSource {
 public:
  /// Reads the device with this serial number; "" for the only one there is. After a connection,
  /// only the device with that serial number is read. Throws UserError if the USB cannot be used.
  explicit UsbSource(std::string serial);
  ~UsbSource() override;
  UsbSource(const UsbSource&) = delete;
  UsbSource& operator=(const UsbSource&) = delete;

  /// Before the first connection it throws UserError for several devices without a choice. It also
  /// throws for a device that may not be opened, or that another program uses. Endpoints that
  /// differ from those of Torquer's firmware are refused too. Without a device the bus is listed
  /// once a second. After a suspend of the host or repeated errors, a device may be present without
  /// a new arrival.
  void Wait(int timeout_ms, const Sink& sink) override;
  void LetGo(const std::string& reason) override;
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
  enum class Trial {
    kOpen,    // ours
    kNotNow,  // fails so far
    kOther,   // not ours, and never will be
  };
  struct OpenDevice {
    libusb_device_handle* handle;
    std::string serial;
    std::string address;
  };

  static int LIBUSB_CALL OnHotplug(libusb_context* context, libusb_device* device,
                                   libusb_hotplug_event event, void* self);
  static void LIBUSB_CALL OnTransfer(libusb_transfer* transfer);

  void ListTheBus();
  bool TakeCandidates();
  bool Waits(libusb_device* device) const;
  void TryCandidates(std::vector<OpenDevice>& found);
  Trial TryOpen(const Candidate& candidate, std::vector<OpenDevice>& found);
  Trial JudgeForbidden(const Candidate& candidate, const std::string& address) const;
  bool IsOurs(const std::string& product, const std::string& serial) const;
  bool Start(const OpenDevice& device);
  bool HasConfiguration(const OpenDevice& device) const;
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
  std::vector<libusb_device*> others_;  // listed devices of other makers with the same ids
  std::int64_t listed_us_ = 0;
  Reopening reopening_;
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
