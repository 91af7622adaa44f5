// The USB device: handles control requests and the queue of input reports. The board sends and
// receives the packets (usb_packets.h).
#pragma once

#include <stdint.h>

#include "firmware/src/usb_stack.h"

namespace torquer {
namespace firmware {

class UsbDevice final : public UsbStack {
 public:
  /// Both arguments must outlive this object; they need not be constructed yet.
  UsbDevice(ReportHandler& reports, LongReportHandler& long_reports)
      : reports_(reports), long_reports_(long_reports) {}

  bool Poll() override;
  bool RequestPending() const override;
  void Hold() override;
  bool configured() const override { return configuration_ != 0; }
  bool may_wake_host() const override { return may_wake_host_; }
  void SendInput(const protocol::InputReport& report) override;
  uint16_t frames_missed() const override { return frames_missed_; }

 private:
  enum class Stage : uint8_t {
    kIdle,
    kDataIn,
    kStatusOut,
    kDataOut,
    kStatusIn,
    kLongIn,     // a long report is being made
    kLongOut,    // its bytes come from the host
    kLongTaken,  // all bytes have arrived and are being handled
  };

  struct Setup {
    uint8_t type;
    uint8_t request;
    uint16_t value;
    uint16_t index;
    uint16_t length;
  };

  void Reset();
  void Begin();
  bool BeginStandard();
  bool BeginHid();
  bool BeginGetDescriptor();
  bool BeginFeature(bool set);
  void SendFlash(const uint8_t* data, uint16_t size);
  void SendBuffer(uint8_t size);
  void SendSerialString();
  bool SendStatus(uint8_t low);
  bool Acknowledge();
  void Send(const uint8_t* data, uint16_t size, bool in_flash);
  void ContinueDataIn();
  void ContinueDataOut();
  void ContinueLongIn();
  void ContinueLongOut();
  void FinishLongOut();
  void LeaveLongReport();
  void FinishStatusIn();

  static constexpr uint8_t kBufferBytes = 34;  // the longest string descriptor
  static constexpr uint8_t kFramesToAbsence = 4;

  ReportHandler& reports_;
  LongReportHandler& long_reports_;
  Setup setup_ = {};
  const uint8_t* data_ = nullptr;
  uint16_t remaining_ = 0;
  uint16_t frames_missed_ = 0;
  uint8_t buffer_[kBufferBytes] = {};
  uint16_t received_ = 0;
  uint8_t configuration_ = 0;
  uint8_t idle_rate_ = 0;
  uint8_t unpolled_frames_ = 0;
  Stage stage_ = Stage::kIdle;
  bool may_wake_host_ = false;
  bool in_flash_ = false;
  bool end_with_empty_packet_ = false;
};

}  // namespace firmware
}  // namespace torquer
