// ATmega32U4 that runs a firmware image, on libsimavr's core. It replaces peripherals that
// libsimavr lacks or models too coarsely; README.md lists them with the reasons. It is independent
// of the connected parts.
#pragma once

#include <cstdint>
#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "host/emulator/firmware_image.h"
#include "host/emulator/flash_memory.h"
#include "host/emulator/usb_controller.h"

struct avr_t;

namespace torquer::emulator {

/// One byte exchanged over the SPI, with the times by which a slave checks the timing.
struct SpiExchange {
  std::uint8_t sent = 0;
  double start_us = 0;  ///< first clock edge, time since power-on
  double end_us = 0;    ///< last clock edge
  double clock_hz = 0;
  int mode = 0;
};

class Atmega32u4 {
 public:
  static constexpr int kEepromBytes = 1024;

  /// Powers the chip on. RAM holds noise made from `seed`, the EEPROM holds `eeprom`. The supply is
  /// also the reference of the converter.
  Atmega32u4(const FirmwareImage& image, const std::vector<std::uint8_t>& eeprom,
             std::uint32_t seed, double supply_mv = 5000);
  ~Atmega32u4();
  Atmega32u4(const Atmega32u4&) = delete;
  Atmega32u4& operator=(const Atmega32u4&) = delete;

  /// Runs until `us` microseconds after power-on (or an instruction past it).
  /// Throws std::runtime_error if the CPU stops for good.
  void RunUntil(double us);
  double now_us() const;

  /// Pulls the reset pin once.
  void ResetByPin();
  /// A short dip of the supply triggers the brown-out detector. A byte of EEPROM that is being
  /// written is lost; the variables stay.
  void ResetByBrownOut();
  /// From now on this peripheral does not answer the firmware.
  enum class Peripheral { kNone, kPll, kSpi, kAdc, kEeprom, kUsbMemory };
  void SetDead(Peripheral peripheral);

  UsbController& usb() { return usb_; }
  /// Call after the host's side of usb() has made a change.
  void UpdateUsbInterrupts();

  /// Input level of a pin, port 'B' .. 'F'; holds over resets.
  void SetPin(char port, int bit, bool high);
  /// Level that the firmware drives on a pin; nullopt if the pin is an input.
  std::optional<bool> DrivenLevel(char port, int bit) const;
  /// Calls `changed` with the new level whenever the firmware changes an output pin.
  void OnPin(char port, int bit, std::function<void(bool high, double now_us)> changed);
  /// Voltage on an ADC channel as a fraction of the reference, 0 .. 1.
  void SetAnalog(int channel, double fraction);
  /// SPI slave that answers each exchange; without one, MISO stays high.
  void SetSpiSlave(std::function<std::uint8_t(const SpiExchange&)> slave) {
    spi_slave_ = std::move(slave);
  }

  /// Flash memory: holds the program, which can also write to it.
  FlashMemory& flash() { return *flash_; }

  /// Contents of the EEPROM after a loss of power at this moment. A byte that is being written has
  /// neither its old nor its new value.
  std::vector<std::uint8_t> EepromAfterPowerLoss();
  const std::vector<std::uint8_t>& eeprom() const { return eeprom_; }
  /// Bytes written by the firmware since power-on, the one being written included.
  int eeprom_writes() const { return eeprom_writes_; }
  /// The cell that is being written; -1 if none is.
  int EepromCellBeingWritten() const;

  /// Executes one instruction; returns the byte address of the next one.
  std::uint32_t StepInstruction();
  std::uint64_t cycles() const;
  /// Cycles in which the CPU was asleep.
  std::uint64_t sleep_cycles() const { return sleep_cycles_; }
  /// Parts of the chip that still draw current while the bus is suspended; empty if all sleep.
  std::vector<std::string> PartsAwake() const;
  /// Resets since power-on, by watchdog, pin or brown-out.
  int resets() const { return resets_; }
  /// Firmware actions that would fail on real silicon, those on the USB included.
  std::vector<std::string> Violations() const;

 private:
  struct Hooks;  // the functions that simavr calls
  friend struct Hooks;

  void AfterReset();
  void ResetFor(std::uint8_t cause);
  void Violation(const std::string& what);

  avr_t* avr_ = nullptr;
  std::unique_ptr<Hooks> hooks_;
  std::unique_ptr<FlashMemory> flash_;
  UsbController usb_;
  std::function<std::uint8_t(const SpiExchange&)> spi_slave_;
  std::vector<std::uint8_t> eeprom_;
  std::map<std::pair<char, int>, bool> pins_;
  std::map<int, double> analog_;
  double cpu_mhz_ = 16;
  double crystal_mhz_ = 16;
  double supply_mv_ = 5000;
  std::uint64_t sleep_cycles_ = 0;
  std::uint32_t noise_ = 1;
  int eeprom_writes_ = 0;
  int resets_ = 0;
  Peripheral dead_ = Peripheral::kNone;
  std::vector<std::string> violations_;
};

}  // namespace torquer::emulator
