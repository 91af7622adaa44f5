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
  /// Room for the largest report but the long ones.
  static constexpr uint8_t kCapacity = 32;

  /// Fills `report` (kCapacity bytes) with the report of that id; returns its size, 0 if there is
  /// none to be read.
  virtual uint8_t GetInputReport(uint8_t id, uint8_t* report) = 0;
  virtual uint8_t GetFeatureReport(uint8_t id, uint8_t* report) = 0;
  /// Takes a feature report; false, and nothing changed, if it is not acceptable. `size` is at most
  /// kCapacity; a host may have padded the report to it.
  virtual bool SetFeatureReport(const uint8_t* report, uint8_t size) = 0;

 protected:
  ~ReportHandler() = default;
};

/// Feature reports that are too long to be kept until they are complete. One at a time.
class LongReportHandler {
 public:
  enum class Progress : uint8_t { kWait, kReady, kRefused };

  /// A report of `size` bytes is about to be written; false if it cannot be taken.
  virtual bool BeginWrite(uint8_t id, uint16_t size) = 0;
  /// True if another packet can be taken. Its bytes come by Put(), the report's id first.
  virtual bool HasRoom() const = 0;
  virtual void Put(uint8_t byte) = 0;
  /// Called after the last byte. Returns kReady if the report was taken.
  virtual Progress EndWrite() = 0;
  /// Begins to read the report; false if there is none.
  virtual bool BeginRead(uint8_t id) = 0;
  /// kReady once: the report, valid until the next BeginWrite() or BeginRead().
  virtual Progress Read(const uint8_t** data, uint16_t* size) = 0;
  /// Called when the host abandons the transfer.
  virtual void Abandon() = 0;

 protected:
  ~LongReportHandler() = default;
};

class UsbDevice {
 public:
  /// `serial` has 16 zero-padded characters. All arguments must outlive this object.
  UsbDevice(ReportHandler& reports, LongReportHandler& long_reports, const char* serial)
      : reports_(reports), long_reports_(long_reports), serial_(serial) {}

  /// Handles the events of endpoint 0 since the last call; never waits. True while a request is
  /// served that does not only wait for the sensor.
  bool Poll();

  /// True if the host has configured the device and wants input reports.
  bool configured() const { return configuration_ != 0; }
  /// True if the host allows the device to wake it.
  bool may_wake_host() const { return may_wake_host_; }

  /// Queues a report. While the host does not poll, the newest report alone is kept for it, so that
  /// what it reads first after a pause is fresh.
  void SendInput(const protocol::InputReport& report);

  /// Frames in which a report found no room; saturates.
  uint16_t frames_missed() const { return frames_missed_; }

 private:
  enum class Stage : uint8_t {
    kIdle,
    kDataIn,
    kStatusOut,
    kDataOut,
    kStatusIn,
    kLongIn,     // a long report is being made
    kLongOut,    // its bytes come from the host
    kLongTaken,  // they have come, and are dealt with
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
  const char* serial_;
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
