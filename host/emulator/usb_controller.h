// The USB device controller of the ATmega32U4: its registers on one side, a host's packets on the
// other. A separate model: simavr's has no banks, no start of frame and no levels.
#pragma once

#include <array>
#include <cstdint>
#include <deque>
#include <functional>
#include <span>
#include <string>
#include <vector>

namespace torquer::emulator {

/// Answer of a device to a packet from the host.
enum class UsbAnswer {
  kAck,   ///< taken, or data sent
  kNak,   ///< not now
  kStall  ///< refused
  ,
  kNone  ///< no answer: detached, another address, endpoint not enabled
};

class UsbController {
 public:
  /// Data space addresses of the registers that Read() and Write() serve.
  static constexpr std::uint16_t kFirstRegister = 0xd7;
  static constexpr std::uint16_t kLastRegister = 0xf4;

  /// Bytes of memory for the endpoints' banks.
  static constexpr unsigned kMemoryBytes = 832;

  UsbController() { Reset(); }

  /// --- the chip's side -----------------------------------------------------------------------
  void Reset();
  /// From now on no endpoint gets memory.
  void ExhaustMemory() { memory_exhausted_ = true; }
  std::uint8_t Read(std::uint16_t address);
  void Write(std::uint16_t address, std::uint8_t value);
  void SetPllLocked(bool locked);
  /// True if clock or PLL runs, which draws current.
  bool Runs() const;
  /// Levels of the two interrupt requests.
  bool general_interrupt() const;
  bool endpoint_interrupt() const;

  /// --- the host's side -----------------------------------------------------------------------
  /// True if the device's pull-up is on the bus.
  bool Attached() const;
  /// Reports an idle bus for the time of a frame; after three idle frames the bus counts as
  /// suspended.
  void IdleFrame();
  /// Reports bus activity without packets: reset or resume by the host.
  void Activity();
  /// Reports the end of a reset.
  void BusReset();
  /// True once for each wake-up that the device sends to the host of a suspended bus.
  bool TakeRemoteWake();
  void StartOfFrame(unsigned frame);
  UsbAnswer Setup(std::uint8_t address, std::span<const std::uint8_t, 8> packet);
  /// On kAck `data` holds the packet and `toggle`, if given, its DATA0 or DATA1.
  UsbAnswer In(std::uint8_t address, std::uint8_t endpoint, std::vector<std::uint8_t>* data,
               bool* toggle = nullptr);
  UsbAnswer Out(std::uint8_t address, std::uint8_t endpoint, std::span<const std::uint8_t> data);

  /// Firmware actions that would fail on real silicon, in order; empty if there were none.
  const std::vector<std::string>& violations() const { return violations_; }

 private:
  struct Endpoint {
    std::uint8_t flags = 0;  // UEINTX without RWAL
    std::uint8_t control = 0;
    std::uint8_t config0 = 0;
    std::uint8_t config1 = 0;
    std::uint8_t enabled_interrupts = 0;
    bool toggle = false;
    bool send_control = false;                     // endpoint 0: the IN bank is the host's
    std::vector<std::uint8_t> filling;             // IN bank of the firmware
    std::deque<std::uint8_t> received;             // OUT or SETUP bank
    std::deque<std::vector<std::uint8_t>> queued;  // IN banks of the host

    bool allocated = false;
    unsigned reserved = 0;  // bytes, while allocated

    bool in() const { return config0 & 1; }
    bool is_control() const { return (config0 >> 6) == 0; }
    unsigned size() const { return 8u << ((config1 >> 4) & 7); }
    unsigned banks() const { return ((config1 >> 2) & 3) + 1; }
  };

  Endpoint& Selected() { return endpoints_[uenum_]; }
  bool ClockRuns() const;
  bool Answers(std::uint8_t address, std::uint8_t endpoint) const;
  void GiveBank(Endpoint& endpoint);
  void WriteFlags(Endpoint& endpoint, std::uint8_t value);
  void WriteControl(Endpoint& endpoint, std::uint8_t value);
  void Disable();
  void WriteConfig1(std::uint8_t value);
  void WriteAddress(std::uint8_t value);
  void ResetBanks(Endpoint& endpoint);
  std::uint8_t ReadFlags(const Endpoint& endpoint) const;
  void Violation(std::string what);

  std::array<Endpoint, 7> endpoints_;
  std::uint8_t uhwcon_ = 0, usbcon_ = 0, usbint_ = 0, udcon_ = 0, udint_ = 0, udien_ = 0,
               udaddr_ = 0;
  std::uint8_t uenum_ = 0, uerst_ = 0;
  unsigned frame_ = 0;
  int idle_frames_ = 0;
  bool pll_locked_ = false;
  bool remote_wake_ = false;
  bool memory_exhausted_ = false;
  std::vector<std::string> violations_;
};

}  // namespace torquer::emulator
