#include "firmware/src/usb_device.h"

#include "firmware/board/usb_packets.h"
#include "firmware/src/serial_number.h"
#include "firmware/src/usb_descriptors.h"

namespace torquer {
namespace firmware {
namespace {

// bmRequestType: direction, type and recipient.
constexpr uint8_t kToHost = 0x80;
constexpr uint8_t kTypeMask = 0x60;
constexpr uint8_t kStandard = 0x00;
constexpr uint8_t kClass = 0x20;
constexpr uint8_t kRecipientMask = 0x1f;
constexpr uint8_t kDevice = 0x00;
constexpr uint8_t kInterface = 0x01;
constexpr uint8_t kEndpoint = 0x02;

enum StandardRequest : uint8_t {
  kGetStatus = 0,
  kClearFeature = 1,
  kSetFeature = 3,
  kSetAddress = 5,
  kGetDescriptor = 6,
  kGetConfiguration = 8,
  kSetConfiguration = 9,
  kGetInterface = 10,
  kSetInterface = 11,
};
// Feature selectors, of the endpoint and of the device, and where the latter's status shows.
constexpr uint16_t kEndpointHalt = 0;
constexpr uint16_t kRemoteWakeup = 1;
constexpr uint8_t kRemoteWakeupStatus = 1 << 1;

enum HidRequest : uint8_t {
  kGetReport = 0x01,
  kGetIdle = 0x02,
  kSetReport = 0x09,
  kSetIdle = 0x0a,
};
enum HidReportType : uint8_t { kInputReport = 1, kFeatureReport = 3 };

constexpr uint8_t kInputEndpointAddress = 0x80 | protocol::kInputEndpoint;

}  // namespace

bool UsbDevice::Poll() {
  // Fast path for the bytes of a long report, which must not be delayed.
  if (stage_ == Stage::kLongOut && board::HasControlData()) {
    const bool room = long_reports_.HasRoom();
    if (room) ContinueLongOut();
    return room;
  }
  if (board::TakeUsbReset()) Reset();
  bool serving = stage_ != Stage::kIdle && stage_ < Stage::kLongIn;
  uint8_t packet[8];
  if (board::TakeSetup(packet)) {
    setup_.type = packet[0];
    setup_.request = packet[1];
    setup_.value = static_cast<uint16_t>(packet[2] | (packet[3] << 8));
    setup_.index = static_cast<uint16_t>(packet[4] | (packet[5] << 8));
    setup_.length = static_cast<uint16_t>(packet[6] | (packet[7] << 8));
    Begin();
    serving = true;
  }
  switch (stage_) {
    case Stage::kIdle:
      break;
    case Stage::kDataIn:
      ContinueDataIn();
      break;
    case Stage::kStatusOut:
      // The empty packet stays until the next SETUP packet. Removing it could remove a SETUP packet
      // that arrives at the same moment.
      if (board::HasControlData()) stage_ = Stage::kIdle;
      break;
    case Stage::kDataOut:
      ContinueDataOut();
      break;
    case Stage::kStatusIn:
      if (board::CanSendControl()) FinishStatusIn();
      break;
    case Stage::kLongIn:
      ContinueLongIn();
      break;
    case Stage::kLongOut:
      break;
    case Stage::kLongTaken:
      FinishLongOut();
      break;
  }
  board::WatchControl(stage_ == Stage::kDataIn || stage_ == Stage::kStatusIn,
                      stage_ == Stage::kDataIn || stage_ == Stage::kStatusOut ||
                          stage_ == Stage::kDataOut ||
                          (stage_ == Stage::kLongOut && long_reports_.HasRoom()));
  return serving;
}

bool UsbDevice::RequestPending() const { return board::ControlPending(); }

void UsbDevice::Hold() { board::HoldControl(); }

void UsbDevice::LeaveLongReport() {
  if (stage_ == Stage::kLongIn || stage_ == Stage::kLongOut || stage_ == Stage::kLongTaken) {
    long_reports_.Abandon();
  }
}

void UsbDevice::Reset() {
  LeaveLongReport();
  stage_ = Stage::kIdle;
  configuration_ = 0;
  may_wake_host_ = false;
  unpolled_frames_ = 0;
}

void UsbDevice::Begin() {
  LeaveLongReport();
  stage_ = Stage::kIdle;
  bool accepted = false;
  if ((setup_.type & kTypeMask) == kStandard) {
    accepted = BeginStandard();
  } else if ((setup_.type & kTypeMask) == kClass && (setup_.type & kRecipientMask) == kInterface &&
             setup_.index == 0) {
    accepted = BeginHid();
  }
  if (!accepted) {
    stage_ = Stage::kIdle;
    board::StallControl();
  }
}

bool UsbDevice::BeginStandard() {
  const bool to_host = setup_.type & kToHost;
  const uint8_t recipient = setup_.type & kRecipientMask;
  if (recipient == kInterface && (setup_.index != 0 || !configured()) &&
      setup_.request != kGetDescriptor) {
    return false;
  }
  if (!to_host && setup_.length != 0) return false;  // no request below has data
  switch (setup_.request) {
    case kGetDescriptor:
      return to_host && BeginGetDescriptor();
    case kGetStatus:
      if (!to_host) return false;
      if (recipient == kEndpoint && setup_.index == kInputEndpointAddress && configured()) {
        return SendStatus(board::InputHalted());
      }
      if (recipient == kDevice) return SendStatus(may_wake_host_ ? kRemoteWakeupStatus : 0);
      return (recipient != kEndpoint || (setup_.index & 0x7f) == 0) && SendStatus(0);
    case kClearFeature:
      return !to_host && BeginFeature(false);
    case kSetFeature:
      return !to_host && BeginFeature(true);
    case kSetAddress:
      if (to_host || recipient != kDevice || setup_.value > 127) return false;
      return Acknowledge();  // FinishStatusIn() does it
    case kGetConfiguration:
      if (!to_host || recipient != kDevice) return false;
      buffer_[0] = configuration_;
      SendBuffer(1);
      return true;
    case kSetConfiguration:
      if (to_host || recipient != kDevice || setup_.value > 1) return false;
      configuration_ = static_cast<uint8_t>(setup_.value);
      unpolled_frames_ = 0;
      if (!board::ConfigureInput(configured())) {
        configuration_ = 0;
        return false;
      }
      return Acknowledge();
    case kGetInterface:
      if (!to_host || recipient != kInterface) return false;
      buffer_[0] = 0;
      SendBuffer(1);
      return true;
    case kSetInterface:
      return !to_host && recipient == kInterface && setup_.value == 0 && Acknowledge();
    default:
      return false;
  }
}

bool UsbDevice::BeginGetDescriptor() {
  const uint8_t index = static_cast<uint8_t>(setup_.value & 0xff);
  switch (setup_.value >> 8) {
    case kDeviceDescriptorType:
      SendFlash(kDeviceDescriptor, sizeof(kDeviceDescriptor));
      return true;
    case kConfigurationDescriptorType:
      if (index != 0) return false;
      SendFlash(kConfigurationDescriptor, sizeof(kConfigurationDescriptor));
      return true;
    case kHidDescriptorType:
      SendFlash(kConfigurationDescriptor + kHidDescriptorOffset, kHidDescriptorBytes);
      return true;
    case kHidReportDescriptorType:
      SendFlash(protocol::kHidReportDescriptor, sizeof(protocol::kHidReportDescriptor));
      return true;
    case kStringDescriptorType:
      switch (index) {
        case kLanguagesString:
          SendFlash(kLanguages, sizeof(kLanguages));
          return true;
        case kManufacturerString:
          SendFlash(kManufacturer.bytes, sizeof(kManufacturer));
          return true;
        case kProductString:
          SendFlash(kProduct.bytes, sizeof(kProduct));
          return true;
        case kSerialString:
          SendSerialString();
          return true;
        default:
          return false;
      }
    default:
      return false;
  }
}

bool UsbDevice::BeginFeature(bool set) {
  const uint8_t recipient = setup_.type & kRecipientMask;
  if (recipient == kDevice) {
    if (setup_.value != kRemoteWakeup || setup_.index != 0) return false;
    may_wake_host_ = set;
    return Acknowledge();
  }
  if (recipient != kEndpoint || setup_.value != kEndpointHalt) return false;
  if ((setup_.index & 0x7f) == 0) return Acknowledge();  // endpoint 0 is never halted for long
  if (setup_.index != kInputEndpointAddress || !configured()) return false;
  board::HaltInput(set);
  return Acknowledge();
}

bool UsbDevice::BeginHid() {
  const bool to_host = setup_.type & kToHost;
  const uint8_t report_type = static_cast<uint8_t>(setup_.value >> 8);
  const uint8_t report_id = static_cast<uint8_t>(setup_.value & 0xff);
  switch (setup_.request) {
    case kGetReport: {
      if (!to_host) return false;
      uint8_t size = 0;
      if (report_type == kInputReport) size = reports_.GetInputReport(report_id, buffer_);
      if (report_type == kFeatureReport) size = reports_.GetFeatureReport(report_id, buffer_);
      if (size == 0) {
        if (report_type != kFeatureReport || !long_reports_.BeginRead(report_id)) return false;
        stage_ = Stage::kLongIn;
        return true;
      }
      SendBuffer(size);
      return true;
    }
    case kSetReport:
      if (to_host || report_type != kFeatureReport) return false;
      if (setup_.length == 0 || setup_.length > protocol::kLongestReportBytes) return false;
      received_ = 0;
      stage_ =
          long_reports_.BeginWrite(report_id, setup_.length) ? Stage::kLongOut : Stage::kDataOut;
      return true;
    case kGetIdle:
      if (!to_host) return false;
      buffer_[0] = idle_rate_;
      SendBuffer(1);
      return true;
    case kSetIdle:
      // The HID class requires that the value is kept and returned. It does not change the rate: a
      // report is sent every millisecond.
      if (to_host || setup_.length != 0) return false;
      idle_rate_ = static_cast<uint8_t>(setup_.value >> 8);
      return Acknowledge();
    default:
      return false;
  }
}

void UsbDevice::SendFlash(const uint8_t* data, uint16_t size) { Send(data, size, true); }

void UsbDevice::SendBuffer(uint8_t size) { Send(buffer_, size, false); }

bool UsbDevice::SendStatus(uint8_t low) {
  buffer_[0] = low;
  buffer_[1] = 0;
  SendBuffer(2);
  return true;
}

void UsbDevice::SendSerialString() {
  const char* const serial = reports_.serial();
  uint8_t size = 2;
  for (uint8_t i = 0; i < kSerialBytes && serial[i] != 0; ++i) {
    buffer_[size++] = static_cast<uint8_t>(serial[i]);
    buffer_[size++] = 0;
  }
  buffer_[0] = size;
  buffer_[1] = kStringDescriptorType;
  SendBuffer(size);
}

void UsbDevice::Send(const uint8_t* data, uint16_t size, bool in_flash) {
  data_ = data;
  in_flash_ = in_flash;
  remaining_ = size < setup_.length ? size : setup_.length;
  // The host knows the end by the length it asked for, or by a packet that is not full.
  end_with_empty_packet_ = size < setup_.length && size % protocol::kControlPacketBytes == 0;
  stage_ = setup_.length == 0 ? Stage::kStatusIn : Stage::kDataIn;
  if (setup_.length == 0) board::SendControl(nullptr, 0, false);
}

bool UsbDevice::Acknowledge() {
  if (setup_.length != 0) return false;
  board::SendControl(nullptr, 0, false);
  stage_ = Stage::kStatusIn;
  return true;
}

void UsbDevice::ContinueDataIn() {
  if (board::HasControlData()) {  // the host has read enough and ends the transfer
    stage_ = Stage::kIdle;
    return;
  }
  if (!board::CanSendControl()) return;
  const uint8_t size = remaining_ < protocol::kControlPacketBytes ? static_cast<uint8_t>(remaining_)
                                                                  : protocol::kControlPacketBytes;
  board::SendControl(data_, size, in_flash_);
  data_ += size;
  remaining_ = static_cast<uint16_t>(remaining_ - size);
  if (remaining_ != 0) return;
  if (end_with_empty_packet_) {
    end_with_empty_packet_ = false;
  } else {
    stage_ = Stage::kStatusOut;
  }
}

void UsbDevice::ContinueDataOut() {
  if (!board::HasControlData()) return;
  const uint8_t size = board::ControlDataSize();
  for (uint8_t i = 0; i < size; ++i, ++received_) {
    const uint8_t byte = board::NextControlByte();
    // A host may pad a report; bytes beyond the longest report are ignored.
    if (received_ < ReportHandler::kCapacity) buffer_[received_] = byte;
  }
  if (!board::ReleaseControlData()) return;
  const bool complete = received_ >= setup_.length;
  if (!complete && size == protocol::kControlPacketBytes) return;
  const uint8_t kept = setup_.length < ReportHandler::kCapacity
                           ? static_cast<uint8_t>(setup_.length)
                           : ReportHandler::kCapacity;
  if (complete && buffer_[0] == (setup_.value & 0xff) && reports_.SetFeatureReport(buffer_, kept)) {
    board::SendControl(nullptr, 0, false);
    stage_ = Stage::kStatusIn;
  } else {
    stage_ = Stage::kIdle;
    board::StallControl();
  }
}

void UsbDevice::ContinueLongOut() {
  const uint8_t size = board::ControlDataSize();
  for (uint8_t i = 0; i < size; ++i) long_reports_.Put(board::NextControlByte());
  if (!board::ReleaseControlData()) return;
  received_ = static_cast<uint16_t>(received_ + size);
  if (received_ >= setup_.length) {
    stage_ = Stage::kLongTaken;
  } else if (size != protocol::kControlPacketBytes) {
    LeaveLongReport();
    stage_ = Stage::kIdle;
    board::StallControl();
  }
}

void UsbDevice::FinishLongOut() {
  const LongReportHandler::Progress progress = long_reports_.EndWrite();
  if (progress == LongReportHandler::Progress::kWait) return;
  if (progress == LongReportHandler::Progress::kReady) {
    board::SendControl(nullptr, 0, false);
    stage_ = Stage::kStatusIn;
  } else {
    stage_ = Stage::kIdle;
    board::StallControl();
  }
}

void UsbDevice::ContinueLongIn() {
  const uint8_t* data = nullptr;
  uint16_t size = 0;
  const LongReportHandler::Progress progress = long_reports_.Read(&data, &size);
  if (progress == LongReportHandler::Progress::kWait) return;
  if (progress == LongReportHandler::Progress::kReady) {
    Send(data, size, false);
  } else {
    stage_ = Stage::kIdle;
    board::StallControl();
  }
}

void UsbDevice::FinishStatusIn() {
  stage_ = Stage::kIdle;
  const bool was_set_address =
      setup_.type == (kStandard | kDevice) && setup_.request == kSetAddress;
  if (was_set_address) board::SetAddress(static_cast<uint8_t>(setup_.value));
}

void UsbDevice::SendInput(const protocol::InputReport& report) {
  const uint8_t queued = board::QueuedInputs();
  const bool absent = unpolled_frames_ >= kFramesToAbsence;
  if (queued == 2) {
    if (!absent) ++unpolled_frames_;
  } else if (queued == 0 || !absent) {
    unpolled_frames_ = 0;
  }
  if (unpolled_frames_ >= kFramesToAbsence) board::DiscardInputs();
  if (!board::QueueInput(reinterpret_cast<const uint8_t*>(&report), sizeof(report)) &&
      frames_missed_ != UINT16_MAX) {
    ++frames_missed_;
  }
}

}  // namespace firmware
}  // namespace torquer
