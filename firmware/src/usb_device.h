// The USB device: what each control request means, and the queue of input reports. The endpoint
// registers are the board's.
#pragma once

#include <stdint.h>

#include "protocol/hid_reports.h"

namespace torquer {
namespace firmware {

/// The HID reports behind the control requests.
class ReportHandler {
 public:
  /// Room for the largest report.
  static constexpr uint8_t kCapacity = 32;

  /// Fills `report` (kCapacity bytes) with the report of that id; returns its size, 0 if there is
  /// none to be read.
  virtual uint8_t GetInputReport(uint8_t id, uint8_t* report) = 0;
  virtual uint8_t GetFeatureReport(uint8_t id, uint8_t* report) = 0;
  /// Takes a feature report; false, and nothing changed, if it is not acceptable.
  virtual bool SetFeatureReport(const uint8_t* report, uint8_t size) = 0;

 protected:
  ~ReportHandler() = default;
};

class UsbDevice {
 public:
  /// `serial` has 16 zero-padded characters. Both arguments must outlive this object.
  UsbDevice(ReportHandler& reports, const char* serial) : reports_(reports), serial_(serial) {}

  /// Moves endpoint 0 on by what has happened since the last call; never waits.
  void Poll();

  /// The host has set up the device: input reports are wanted.
  bool configured() const { return configuration_ != 0; }
  /// The host wants to be woken when it sleeps.
  bool may_wake_host() const { return may_wake_host_; }

  /// Queues a report. While the host does not poll, the newest report alone is kept for it, so that
  /// what it reads first after a pause is fresh.
  void SendInput(const protocol::InputReport& report);

  /// Frames in which a report found no room; saturates.
  uint16_t frames_missed() const { return frames_missed_; }

 private:
  enum class Stage : uint8_t { kIdle, kDataIn, kStatusOut, kDataOut, kStatusIn };

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
  void FinishStatusIn();

  static constexpr uint8_t kBufferBytes = 34;  // the longest string descriptor
  static constexpr uint8_t kFramesToAbsence = 4;

  ReportHandler& reports_;
  const char* serial_;
  Setup setup_ = {};
  const uint8_t* data_ = nullptr;
  uint16_t remaining_ = 0;
  uint16_t frames_missed_ = 0;
  uint8_t buffer_[kBufferBytes] = {};
  uint8_t received_ = 0;
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
