#include "firmware/bootloader/usb.h"

#include <avr/boot.h>
#include <avr/eeprom.h>
#include <avr/io.h>
#include <avr/pgmspace.h>
#include <string.h>
#include <util/delay.h>

#include "firmware/board/atmega32u4/clock.h"
#include "firmware/bootloader/application.h"
#include "firmware/src/usb_descriptors.h"
#include "protocol/bootloader_reports.h"
#include "protocol/hid_reports.h"
#include "protocol/serial_number.h"
#include "protocol/usb_ids.h"

namespace torquer {
namespace bootloader {
namespace {

using firmware::High;
using firmware::Low;

constexpr uint8_t kPacketBytes = protocol::kControlPacketBytes;
constexpr uint8_t kPacket32 = _BV(EPSIZE1);  // endpoint size code
static_assert(kPacketBytes == 32, "kPacket32");

// Requests: bRequest, with direction and type of bmRequestType in the upper byte. First the
// requests of USB 2.0, chapter 9, without SET_DESCRIPTOR (optional) and SYNCH_FRAME (isochronous
// endpoints only). Then the requests of HID.
enum Request : uint8_t {
  kGetStatus = 0x80,
  kClearFeature = 0x01,
  kSetFeature = 0x03,
  kSetAddress = 0x05,
  kGetDescriptor = 0x86,
  kGetConfiguration = 0x88,
  kSetConfiguration = 0x09,
  kGetInterface = 0x8a,
  kSetInterface = 0x0b,
  kGetReport = 0xa1,
  kSetReport = 0x29,
  kSetIdle = 0x2a,
};
constexpr uint8_t kMostRequest = 0x0b;
constexpr uint8_t kDirectionAndType = 0xe0;
constexpr uint8_t kRecipient = 0x1f;
constexpr uint8_t kEndpointRecipient = 2;
constexpr uint16_t kEndpointHalt = 0;
constexpr uint8_t kInputEndpointAddress = 0x80 | protocol::kInputEndpoint;
constexpr uint8_t kToHost = 0x80;
// Bits of UECONX that end a halt; the data toggle then begins with DATA0.
constexpr uint8_t kFreed = _BV(STALLRQC) | _BV(RSTDT);
static_assert(_BV(EPEN) == 1, "configuration 1 enables the endpoint, 0 disables it");

constexpr uint16_t FeatureReport(uint8_t id) { return static_cast<uint16_t>(0x0300 | id); }

// clang-format off
constexpr uint8_t kDeviceDescriptor[] TORQUER_IN_FLASH = {
    18, firmware::kDeviceDescriptorType,
    0x00, 0x02,                    // USB 2.0
    0, 0, 0,                       // class: by interface
    kPacketBytes,
    Low(protocol::kUsbVendorId), High(protocol::kUsbVendorId),
    Low(protocol::kUsbBootloaderProductId), High(protocol::kUsbBootloaderProductId),
    0, protocol::kBootloaderProtocolVersion,
    firmware::kManufacturerString, firmware::kProductString, 0,
    1,                             // configurations
};

// An interrupt endpoint that never sends data: HID drivers require one.
constexpr uint8_t kConfigurationDescriptor[] TORQUER_IN_FLASH = {
    9, firmware::kConfigurationDescriptorType, 34, 0, 1, 1, 0, 0x80, 100 / 2,
    9, firmware::kInterfaceDescriptorType, 0, 0, 1, 0x03, 0, 0, 0,
    9, firmware::kHidDescriptorType, 0x11, 0x01, 0, 1, firmware::kHidReportDescriptorType,
    sizeof(protocol::kBootloaderReportDescriptor), 0,
    7, firmware::kEndpointDescriptorType, 0x80 | protocol::kInputEndpoint, 0x03, 8, 0, 255,
};
static_assert(sizeof(kConfigurationDescriptor) == 34, "its own total length field");

constexpr auto kProduct TORQUER_IN_FLASH =
    firmware::MakeStringDescriptor(protocol::kUsbBootloaderProduct);
// clang-format on

// True if the host has reset the bus or sent a new request; the current transfer must then be
// abandoned.
bool Superseded() { return (UDINT & _BV(EORSTI)) || (UEINTX & _BV(RXSTPI)); }

// Waits for a flag of endpoint 0; false if the host has begun something else.
bool WaitFor(uint8_t flag) {
  while (!(UEINTX & flag)) {
    if (Superseded()) return false;
  }
  return true;
}

void Acknowledge() {
  if (Superseded()) return;
  UEINTX = static_cast<uint8_t>(~_BV(TXINI));
  WaitFor(_BV(TXINI));
}

// First bytes of a status report.
constexpr uint8_t kStatusHead[] TORQUER_IN_FLASH = {protocol::kBootloaderStatusReportId,
                                                    protocol::kBootloaderProtocolVersion,
                                                    board::kImageBoard, board::kClock};
static_assert(sizeof(kStatusHead) == offsetof(protocol::BootloaderStatusReport, trailer),
              "all before the trailer");

struct Descriptor {
  uint16_t value;  // of GET_DESCRIPTOR
  const uint8_t* bytes;
  uint8_t size;
};
constexpr uint16_t Value(uint8_t type, uint8_t index) {
  return static_cast<uint16_t>(type << 8 | index);
}
const Descriptor kDescriptors[] TORQUER_IN_FLASH = {
    {Value(firmware::kDeviceDescriptorType, 0), kDeviceDescriptor, sizeof(kDeviceDescriptor)},
    {Value(firmware::kConfigurationDescriptorType, 0), kConfigurationDescriptor,
     sizeof(kConfigurationDescriptor)},
    {Value(firmware::kHidReportDescriptorType, 0), protocol::kBootloaderReportDescriptor,
     sizeof(protocol::kBootloaderReportDescriptor)},
    {Value(firmware::kStringDescriptorType, 0), firmware::kLanguages, sizeof(firmware::kLanguages)},
    {Value(firmware::kStringDescriptorType, firmware::kManufacturerString),
     firmware::kManufacturer.bytes, sizeof(firmware::kManufacturer)},
    {Value(firmware::kStringDescriptorType, firmware::kProductString), kProduct.bytes,
     sizeof(kProduct)},
};

}  // namespace

UsbServer::UsbServer(bool application_valid) : application_valid_(application_valid) {
  UHWCON = _BV(UVREGE);
  USBCON = _BV(USBE) | _BV(FRZCLK);
  board::StartPll();
  USBCON = _BV(USBE) | _BV(OTGPADE);
  UDCON = 0;  // full speed, attached
}

void UsbServer::Run() {
  while (!restart_wanted_) {
    if (UDINT & _BV(EORSTI)) {
      UDINT = 0;
      configuration_ = 0;
      UENUM = 0;
      UECONX = _BV(EPEN);
      UECFG0X = 0;
      UECFG1X = kPacket32 | _BV(ALLOC);
    }
    if (!(UEINTX & _BV(RXSTPI))) continue;
    uint8_t* bytes = reinterpret_cast<uint8_t*>(&setup_);
    for (uint8_t i = 0; i < sizeof(setup_); ++i) bytes[i] = UEDATX;
    UEINTX = static_cast<uint8_t>(~(_BV(RXSTPI) | _BV(RXOUTI)));
    if (!Serve()) UECONX = _BV(STALLRQ) | _BV(EPEN);
  }
  _delay_ms(10);  // the acknowledgment goes out
  UDCON = _BV(DETACH);
}

// False if the request must be stalled. A request that the host has abandoned needs no answer.
bool UsbServer::Serve() {
  if (setup_.request > kMostRequest) return false;
  const uint8_t request = (setup_.type & kDirectionAndType) | setup_.request;
  uint8_t value = 0;
  switch (request) {
    case kGetDescriptor:
      return SendDescriptor();
    case kGetReport:
      return SendReport();
    case kSetReport:
      return TakeReport();
    case kSetAddress:
      UDADDR = setup_.value & 0x7f;
      Acknowledge();
      UDADDR |= _BV(ADDEN);
      return true;
    case kGetStatus:
    case kClearFeature:
    case kSetFeature:
      if ((setup_.type & kRecipient) != kEndpointRecipient) {
        if (request != kGetStatus) return false;  // the device has no feature
        break;
      }
      if (setup_.value != kEndpointHalt) return false;
      if (setup_.index == kInputEndpointAddress && configuration_ != 0) {
        UENUM = protocol::kInputEndpoint;
        if (request == kSetFeature) UECONX = _BV(STALLRQ) | _BV(EPEN);
        if (request == kClearFeature) UECONX = kFreed | _BV(EPEN);
        if (UECONX & _BV(STALLRQ)) value = 1;
      } else if (setup_.index & 0x7f) {  // endpoint 0 is never halted for long
        return false;
      }
      break;
    case kGetConfiguration:
      value = configuration_;
      break;
    case kSetConfiguration:
      if (setup_.value > 1) return false;
      configuration_ = static_cast<uint8_t>(setup_.value);
      UENUM = protocol::kInputEndpoint;
      UECONX = _BV(EPEN);
      UECFG0X = _BV(EPTYPE1) | _BV(EPTYPE0) | _BV(EPDIR);  // interrupt, IN
      UECFG1X = _BV(ALLOC);                                // 8 bytes, one bank
      UECONX = static_cast<uint8_t>(kFreed | configuration_);
      break;
    case kGetInterface:
    case kSetInterface:
      if (configuration_ == 0 || setup_.value != 0) return false;
      break;
    case kSetIdle:
      break;
    default:
      return false;
  }
  UENUM = 0;
  if (setup_.type & kToHost) {  // a number of one or two bytes
    report_.bytes[0] = value;
    report_.bytes[1] = 0;
    Send(report_.bytes, 2, false);
  } else {
    Acknowledge();
  }
  return true;
}

bool UsbServer::SendDescriptor() {
  for (const Descriptor& each : kDescriptors) {
    Descriptor descriptor;
    memcpy_P(&descriptor, &each, sizeof(descriptor));
    if (descriptor.value != setup_.value) continue;
    Send(descriptor.bytes, descriptor.size, true);
    return true;
  }
  return false;
}

bool UsbServer::SendReport() {
  uint8_t size;
  if (setup_.value == FeatureReport(protocol::kBootloaderStatusReportId)) {
    size = sizeof(report_.status);
    memset(report_.bytes, 0, size);
    memcpy_P(report_.bytes, kStatusHead, sizeof(kStatusHead));
    ReadTrailer(&report_.status.trailer);
    report_.status.application_valid = application_valid_;
    eeprom_read_block(&report_.status.given_serial,
                      reinterpret_cast<const void*>(protocol::kEepromSerialAddress),
                      sizeof(report_.status.given_serial));
    for (uint8_t i = 0; i < protocol::kChipSerialBytes; ++i) {
      report_.status.chip_serial[i] = boot_signature_byte_get(protocol::kChipSerialAddress + i);
    }
  } else if (setup_.value == FeatureReport(protocol::kPageReportId)) {
    size = sizeof(report_.page);
    report_.page.report_id = protocol::kPageReportId;
    report_.page.spare = 0;
    report_.page.address = selected_page_;
    memcpy_P(report_.page.data, reinterpret_cast<const void*>(selected_page_),
             protocol::kFlashPageBytes);
    selected_page_ += protocol::kFlashPageBytes;
  } else {
    return false;
  }
  Send(report_.bytes, size, false);
  return true;
}

// Sends the requested part of `size` bytes; the host may end the transfer early.
void UsbServer::Send(const uint8_t* data, uint8_t size, bool in_flash) {
  // The host knows the end by the length it asked for, or by a packet that is not full.
  const bool all_wanted = setup_.length <= size;
  if (all_wanted) size = static_cast<uint8_t>(setup_.length);
  bool ended = false;
  while (!Superseded()) {
    const uint8_t flags = UEINTX;
    // The host has ended the transfer. Its empty packet stays until the next SETUP packet. Removing
    // it could remove a SETUP packet that arrives at the same moment.
    if (flags & _BV(RXOUTI)) return;
    if (ended || !(flags & _BV(TXINI))) continue;
    uint8_t packet = size < kPacketBytes ? size : kPacketBytes;
    size = static_cast<uint8_t>(size - packet);
    ended = size == 0 && (all_wanted || packet < kPacketBytes);
    for (; packet != 0; --packet, ++data) UEDATX = in_flash ? pgm_read_byte(data) : *data;
    UEINTX = static_cast<uint8_t>(~_BV(TXINI));
  }
}

bool UsbServer::TakeReport() {
  if (setup_.length > sizeof(report_)) return false;
  uint8_t received = 0;
  while (received < setup_.length) {
    if (!WaitFor(_BV(RXOUTI))) return true;
    for (uint8_t left = UEBCLX; left != 0; --left) {
      const uint8_t byte = UEDATX;
      if (received < sizeof(report_)) report_.bytes[received++] = byte;
    }
    if (Superseded()) return true;  // clearing the flag could remove a SETUP packet
    UEINTX = static_cast<uint8_t>(~_BV(RXOUTI));
  }
  if (!Execute()) return false;
  Acknowledge();
  return true;
}

// Carries out the report's command; false if it fails.
bool UsbServer::Execute() {
  // A host may pad a report to the length of the longest, which is the page.
  if (report_.bytes[0] == protocol::kPageReportId && setup_.length == sizeof(report_.page)) {
    const bool written = WritePage(report_.page.address, report_.page.data, &trailer_erased_);
    if (written) application_valid_ = !trailer_erased_;
    return written;
  }
  if (report_.bytes[0] == protocol::kBootloaderCommandReportId &&
      setup_.length >= sizeof(report_.command) && report_.command.key == protocol::kCommandKey) {
    if (report_.command.command == protocol::kBootloaderSelectPage) {
      selected_page_ = report_.command.address;
      return true;
    }
    restart_wanted_ = report_.command.command == protocol::kBootloaderRestart;
    return restart_wanted_;
  }
  return false;
}

}  // namespace bootloader
}  // namespace torquer
