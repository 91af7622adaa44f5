#include "host/emulator/usb_controller.h"

#include <cstdio>
#include <utility>

namespace torquer::emulator {
namespace {

enum Register : std::uint16_t {
  kUhwcon = 0xd7,
  kUsbcon = 0xd8,
  kUsbint = 0xda,
  kUdcon = 0xe0,
  kUdint = 0xe1,
  kUdien = 0xe2,
  kUdaddr = 0xe3,
  kUdfnuml = 0xe4,
  kUdfnumh = 0xe5,
  kUeintx = 0xe8,
  kUenum = 0xe9,
  kUerst = 0xea,
  kUeconx = 0xeb,
  kUecfg0x = 0xec,
  kUecfg1x = 0xed,
  kUesta0x = 0xee,
  kUeienx = 0xf0,
  kUedatx = 0xf1,
  kUebclx = 0xf2,
  kUeint = 0xf4,
};

// USBCON, UDCON, UDINT, UDADDR
constexpr std::uint8_t kUsbe = 0x80, kFrzclk = 0x20, kOtgpade = 0x10, kVbuste = 0x01;
constexpr std::uint8_t kVbusti = 0x01;  // USBINT
constexpr std::uint8_t kDetach = 0x01, kRmwkup = 0x02;
constexpr std::uint8_t kSuspi = 0x01, kSofi = 0x04, kEorsti = 0x08, kWakeupi = 0x10;
constexpr int kFramesToSuspend = 3;
constexpr std::uint8_t kAdden = 0x80;
// UEINTX; kRxouti is KILLBK on IN endpoints.
constexpr std::uint8_t kTxini = 0x01, kStalledi = 0x02, kRxouti = 0x04, kRxstpi = 0x08,
                       kNakouti = 0x10, kRwal = 0x20, kNakini = 0x40, kFifocon = 0x80;
// UECONX, UECFG1X
constexpr std::uint8_t kEpen = 0x01, kRstdt = 0x08, kStallrqc = 0x10, kStallrq = 0x20;
constexpr std::uint8_t kAlloc = 0x02;
constexpr std::uint8_t kCfgok = 0x80;

}  // namespace

void UsbController::Reset() {
  Disable();
  uhwcon_ = usbint_ = 0;
  usbcon_ = kFrzclk;
  pll_locked_ = false;
}

// Effect of clearing USBE: resets everything that is not in UHWCON and USBCON.
void UsbController::Disable() {
  endpoints_ = {};
  udint_ = udien_ = udaddr_ = uenum_ = uerst_ = 0;
  udcon_ = kDetach;
  idle_frames_ = 0;
  remote_wake_ = false;
}

void UsbController::SetPllLocked(bool locked) {
  if (!locked && ClockRuns()) Violation("PLLCSR: stopped while the USB's clock is not frozen");
  pll_locked_ = locked;
}

bool UsbController::ClockRuns() const {
  return (usbcon_ & kUsbe) && !(usbcon_ & kFrzclk) && pll_locked_;
}

bool UsbController::Runs() const { return pll_locked_ || !(usbcon_ & kFrzclk); }

// With a frozen clock, only the VBUS and wake-up interrupts still occur.
bool UsbController::general_interrupt() const {
  if (usbcon_ & kVbuste && usbint_ & kVbusti) return true;
  return (udint_ & udien_ & (ClockRuns() ? 0xff : kWakeupi)) != 0;
}

void UsbController::Violation(std::string what) {
  constexpr std::size_t kKept = 100;
  if (violations_.size() < kKept) violations_.push_back(std::move(what));
}

bool UsbController::endpoint_interrupt() const {
  for (const Endpoint& endpoint : endpoints_) {
    if (endpoint.flags & endpoint.enabled_interrupts) return true;
  }
  return false;
}

bool UsbController::Attached() const {
  return (usbcon_ & kUsbe) && (usbcon_ & kOtgpade) && !(udcon_ & kDetach);
}

std::uint8_t UsbController::ReadFlags(const Endpoint& endpoint) const {
  const bool readable = !endpoint.received.empty();
  const bool writable =
      endpoint.in() && (endpoint.flags & kFifocon) && endpoint.filling.size() < endpoint.size();
  return endpoint.flags | (readable || writable ? kRwal : 0);
}

std::uint8_t UsbController::Read(std::uint16_t address) {
  Endpoint& endpoint = Selected();
  switch (address) {
    case kUhwcon:
      return uhwcon_;
    case kUsbcon:
      return usbcon_;
    case kUsbint:
      return usbint_;
    case kUdcon:
      return udcon_;
    case kUdint:
      return udint_;
    case kUdien:
      return udien_;
    case kUdaddr:
      return udaddr_;
    case kUdfnuml:
      return static_cast<std::uint8_t>(frame_);
    case kUdfnumh:
      return (frame_ >> 8) & 7;
    case kUeintx:
      return ReadFlags(endpoint);
    case kUenum:
      return uenum_;
    case kUerst:
      return uerst_;
    case kUeconx:
      return endpoint.control;
    case kUecfg0x:
      return endpoint.config0;
    case kUecfg1x:
      return endpoint.config1;
    case kUesta0x:
      return static_cast<std::uint8_t>((endpoint.allocated ? kCfgok : 0) | endpoint.queued.size());
    case kUeienx:
      return endpoint.enabled_interrupts;
    case kUedatx: {
      if (endpoint.received.empty()) {
        Violation("UEDATX read from an empty endpoint " + std::to_string(uenum_));
        return 0;
      }
      const std::uint8_t byte = endpoint.received.front();
      endpoint.received.pop_front();
      return byte;
    }
    case kUebclx:
      return static_cast<std::uint8_t>(endpoint.in() ? endpoint.filling.size()
                                                     : endpoint.received.size());
    case kUeint: {
      std::uint8_t bits = 0;
      for (std::size_t i = 0; i < endpoints_.size(); ++i) {
        if (endpoints_[i].flags & endpoints_[i].enabled_interrupts) bits |= 1u << i;
      }
      return bits;
    }
    default:
      return 0;
  }
}

void UsbController::Write(std::uint16_t address, std::uint8_t value) {
  Endpoint& endpoint = Selected();
  if (address != kUhwcon && address != kUsbcon && address != kUsbint && !ClockRuns()) {
    char text[80];
    std::snprintf(text, sizeof(text), "register 0x%02x written while the USB's clock stands still",
                  static_cast<unsigned>(address));
    Violation(text);
    return;
  }
  switch (address) {
    case kUhwcon:
      uhwcon_ = value;
      break;
    case kUsbint:
      usbint_ &= value;
      break;
    case kUsbcon:
      // The cable's voltage is seen by the pad, and its coming with it.
      if ((value & kOtgpade) && !(usbcon_ & kOtgpade)) usbint_ |= kVbusti;
      usbcon_ = value;
      if (!(value & kUsbe)) Disable();
      if ((value & kUsbe) && !(value & kFrzclk) && !pll_locked_) {
        Violation("USBCON: the clock let run before the PLL has locked");
      }
      break;
    case kUdcon:
      udcon_ = value & static_cast<std::uint8_t>(~kRmwkup);
      if (value & kRmwkup) {
        if (!(udint_ & kSuspi)) Violation("UDCON: RMWKUP without SUSPI sends nothing");
        remote_wake_ = (udint_ & kSuspi) != 0;
      }
      break;
    case kUdint:
      udint_ &= value;  // a flag is cleared by writing 0
      break;
    case kUdien:
      udien_ = value;
      break;
    case kUdaddr:
      WriteAddress(value);
      break;
    case kUenum:
      if (value >= endpoints_.size()) Violation("UENUM " + std::to_string(value));
      uenum_ = value % endpoints_.size();
      break;
    case kUerst:
      uerst_ = value;
      for (std::size_t i = 0; i < endpoints_.size(); ++i) {
        if (value & (1u << i)) {
          endpoints_[i].queued.clear();
          if (endpoints_[i].allocated) ResetBanks(endpoints_[i]);
        }
      }
      break;
    case kUeconx:
      WriteControl(endpoint, value);
      break;
    case kUecfg0x:
      endpoint.config0 = value;
      break;
    case kUecfg1x:
      WriteConfig1(value);
      break;
    case kUeintx:
      WriteFlags(endpoint, value);
      break;
    case kUeienx:
      endpoint.enabled_interrupts = value;
      break;
    case kUedatx:
      if (endpoint.filling.size() >= endpoint.size() ||
          (!endpoint.is_control() && !(endpoint.flags & kFifocon))) {
        Violation("UEDATX written without room on endpoint " + std::to_string(uenum_));
      } else {
        endpoint.filling.push_back(value);
      }
      break;
    default:
      break;
  }
}

// The address is stored in one write and enabled in another, after the status stage.
void UsbController::WriteAddress(std::uint8_t value) {
  const bool enabled_now = (value & kAdden) && !(udaddr_ & kAdden);
  if (enabled_now && (value & ~kAdden) != udaddr_) {
    Violation("UDADDR: address and ADDEN in one write");
  }
  udaddr_ = value;
}

// The endpoints get memory in rising order. If an endpoint changes its size, the memory of the
// higher endpoints moves, and its contents are lost.
void UsbController::WriteConfig1(std::uint8_t value) {
  Endpoint& endpoint = Selected();
  endpoint.config1 = value;
  const unsigned needed = value & kAlloc ? endpoint.size() * endpoint.banks() : 0;
  unsigned others = 0;
  for (std::size_t i = 0; i < endpoints_.size(); ++i) {
    if (&endpoints_[i] == &endpoint) continue;
    others += endpoints_[i].reserved;
    if (i > uenum_ && endpoints_[i].allocated && needed != endpoint.reserved) {
      Violation("UECFG1X: endpoint " + std::to_string(uenum_) +
                " changes its memory while endpoint " + std::to_string(i) + " above it has some");
    }
  }
  const unsigned largest = uenum_ == 1 ? 256 : 64;
  endpoint.allocated = needed != 0 && endpoint.banks() <= 2 && endpoint.size() <= largest &&
                       others + needed <= kMemoryBytes && !memory_exhausted_;
  endpoint.reserved = endpoint.allocated ? needed : 0;
  ResetBanks(endpoint);
}

void UsbController::ResetBanks(Endpoint& endpoint) {
  endpoint.filling.clear();
  endpoint.received.clear();
  endpoint.queued.clear();
  endpoint.send_control = false;
  endpoint.flags = 0;
  if (!endpoint.allocated) return;
  if (endpoint.is_control()) {
    endpoint.flags = kTxini;
  } else if (endpoint.in()) {
    endpoint.flags = kTxini | kFifocon;
  }
}

void UsbController::WriteControl(Endpoint& endpoint, std::uint8_t value) {
  std::uint8_t stall = endpoint.control & kStallrq;
  if (value & kStallrqc) stall = 0;
  if (value & kStallrq) stall = kStallrq;
  endpoint.control = (value & kEpen) | stall;
  if (value & kRstdt) endpoint.toggle = false;
  if (!(value & kEpen)) endpoint.flags = 0;
}

void UsbController::GiveBank(Endpoint& endpoint) {
  if (!(endpoint.flags & kFifocon) && endpoint.queued.size() < endpoint.banks()) {
    endpoint.flags |= kFifocon | kTxini;
  }
}

void UsbController::WriteFlags(Endpoint& endpoint, std::uint8_t value) {
  const std::uint8_t cleared = endpoint.flags & ~value;
  endpoint.flags &= value | kFifocon;
  if (endpoint.is_control()) {
    if (cleared & kRxstpi) {
      endpoint.received.clear();
      endpoint.filling.clear();
      endpoint.flags |= kTxini;
    }
    if (cleared & kRxouti) endpoint.received.clear();
    // Clearing TXINI hands the bank to the host, but not in the moment that a SETUP is taken.
    if ((cleared & kTxini) && !(cleared & kRxstpi)) endpoint.send_control = true;
    return;
  }
  if (!endpoint.in()) return;
  if ((value & kRxouti) && (cleared & (kFifocon | kTxini))) {
    Violation("UEINTX: KILLBK written as 1 together with a packet on its way");
  }
  if ((value & kRxouti) && !endpoint.queued.empty()) {  // KILLBK
    endpoint.queued.pop_back();
    GiveBank(endpoint);
  }
  if (cleared & kFifocon) {
    endpoint.flags &= static_cast<std::uint8_t>(~kFifocon);
    endpoint.queued.push_back(std::exchange(endpoint.filling, {}));
    GiveBank(endpoint);
  }
}

bool UsbController::Answers(std::uint8_t address, std::uint8_t endpoint) const {
  const std::uint8_t own = udaddr_ & kAdden ? udaddr_ & 0x7f : 0;
  return Attached() && ClockRuns() && address == own && endpoint < endpoints_.size() &&
         (endpoints_[endpoint].control & kEpen) && endpoints_[endpoint].allocated;
}

void UsbController::IdleFrame() {
  if (!Attached() || ++idle_frames_ != kFramesToSuspend || !ClockRuns()) return;
  udint_ |= kSuspi;
}

void UsbController::Activity() {
  idle_frames_ = 0;
  remote_wake_ = false;
  if (Attached()) udint_ |= kWakeupi;
}

void UsbController::BusReset() {
  Activity();
  if (!ClockRuns()) return;  // it goes unseen
  // The endpoints are disabled, and keep the memory that they were given.
  for (Endpoint& endpoint : endpoints_) {
    endpoint.control = 0;
    endpoint.enabled_interrupts = 0;
    endpoint.toggle = false;
    ResetBanks(endpoint);
  }
  udaddr_ = 0;
  udint_ |= kEorsti;
}

bool UsbController::TakeRemoteWake() { return std::exchange(remote_wake_, false); }

void UsbController::StartOfFrame(unsigned frame) {
  Activity();
  if (!Attached() || !ClockRuns()) return;
  frame_ = frame;
  udint_ |= kSofi;
}

UsbAnswer UsbController::Setup(std::uint8_t address, std::span<const std::uint8_t, 8> packet) {
  if (!Answers(address, 0)) return UsbAnswer::kNone;
  Endpoint& control = endpoints_[0];
  control.control &= static_cast<std::uint8_t>(~kStallrq);
  control.send_control = false;
  control.filling.clear();
  control.received.assign(packet.begin(), packet.end());
  control.flags = static_cast<std::uint8_t>((control.flags & ~kTxini) | kRxstpi);
  return UsbAnswer::kAck;
}

UsbAnswer UsbController::In(std::uint8_t address, std::uint8_t endpoint,
                            std::vector<std::uint8_t>* data, bool* toggle) {
  if (!Answers(address, endpoint)) return UsbAnswer::kNone;
  Endpoint& from = endpoints_[endpoint];
  if (from.control & kStallrq) {
    from.flags |= kStalledi;
    return UsbAnswer::kStall;
  }
  if (from.is_control()) {
    if ((from.flags & kRxstpi) || !from.send_control) {
      from.flags |= kNakini;
      return UsbAnswer::kNak;
    }
    from.send_control = false;
    *data = std::exchange(from.filling, {});
    from.flags |= kTxini;
    return UsbAnswer::kAck;
  }
  if (!from.in()) return UsbAnswer::kNone;
  if (from.queued.empty()) {
    from.flags |= kNakini;
    return UsbAnswer::kNak;
  }
  *data = std::move(from.queued.front());
  from.queued.pop_front();
  if (toggle) *toggle = from.toggle;
  from.toggle = !from.toggle;
  GiveBank(from);
  return UsbAnswer::kAck;
}

UsbAnswer UsbController::Out(std::uint8_t address, std::uint8_t endpoint,
                             std::span<const std::uint8_t> data) {
  if (!Answers(address, endpoint)) return UsbAnswer::kNone;
  Endpoint& to = endpoints_[endpoint];
  if (to.control & kStallrq) {
    to.flags |= kStalledi;
    return UsbAnswer::kStall;
  }
  if ((to.flags & kRxstpi) || (to.flags & kRxouti)) {
    to.flags |= kNakouti;
    return UsbAnswer::kNak;
  }
  if (data.size() > to.size()) return UsbAnswer::kNone;
  to.received.assign(data.begin(), data.end());
  to.flags |= kRxouti;
  return UsbAnswer::kAck;
}

}  // namespace torquer::emulator
