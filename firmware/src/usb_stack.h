// Contract of a USB stack, which exchanges whole reports with the firmware. UsbDevice is our stack,
// on the packets of a controller; a board may have another.
#pragma once

#include <stdint.h>

#include "protocol/hid_reports.h"

namespace torquer {
namespace firmware {

/// The HID reports behind the control requests.
class ReportHandler {
 public:
  /// Size of the largest report, without the long reports.
  static constexpr uint8_t kCapacity = 32;

  /// Fills `report` (kCapacity bytes) with the report of that id. Returns its size, or 0 if that id
  /// cannot be read.
  virtual uint8_t GetInputReport(uint8_t id, uint8_t* report) = 0;
  virtual uint8_t GetFeatureReport(uint8_t id, uint8_t* report) = 0;
  /// Takes a feature report. Returns false without a change if the report is not acceptable. `size`
  /// is at most kCapacity; a host may have padded the report.
  virtual bool SetFeatureReport(const uint8_t* report, uint8_t size) = 0;
  /// Serial number of the device: kSerialBytes zero-padded characters.
  virtual const char* serial() const = 0;

 protected:
  ~ReportHandler() = default;
};

/// Feature reports that are too long for a buffer, so that their bytes pass one by one. One report
/// at a time.
class LongReportHandler {
 public:
  enum class Progress : uint8_t { kWait, kReady, kRefused };

  /// Begins to write a report of `size` bytes; false if it is refused.
  virtual bool BeginWrite(uint8_t id, uint16_t size) = 0;
  /// True if there is room for another packet. Put() takes its bytes, the report's id first.
  virtual bool HasRoom() const = 0;
  virtual void Put(uint8_t byte) = 0;
  /// Called after the last byte. Returns kReady if the report was taken.
  virtual Progress EndWrite() = 0;
  /// Begins to read the report; false if there is none.
  virtual bool BeginRead(uint8_t id) = 0;
  /// After kReady: the report, valid until the next BeginWrite() or BeginRead().
  virtual Progress Read(const uint8_t** data, uint16_t* size) = 0;
  /// Called when the host abandons the transfer.
  virtual void Abandon() = 0;

 protected:
  ~LongReportHandler() = default;
};

/// Calls a ReportHandler and a LongReportHandler from Poll() alone, never from an interrupt. The
/// constructor of the implementation takes these handlers. usb_descriptors.h and
/// protocol/hid_descriptor.h have the descriptors and ids.
class UsbStack {
 public:
  /// Handles the requests of the host since the last call; never waits for it. True while a request
  /// is served that does not only wait for the sensor.
  virtual bool Poll() = 0;
  /// True if the host waits for Poll(). This is the fastest check.
  virtual bool RequestPending() const = 0;
  /// From now on a request does not end board::Idle(), until the next Poll().
  virtual void Hold() = 0;

  /// True if the host has configured the device and wants input reports.
  virtual bool configured() const = 0;
  /// True if the host allows the device to wake it.
  virtual bool may_wake_host() const = 0;

  /// Queues a report. While the host does not poll, only the newest report is kept. So the host
  /// reads fresh data after a pause.
  virtual void SendInput(const protocol::InputReport& report) = 0;
  /// Frames whose report found no room in the queue; saturates.
  virtual uint16_t frames_missed() const = 0;

 protected:
  ~UsbStack() = default;
};

}  // namespace firmware
}  // namespace torquer
