// Functions that libsimavr calls for the peripherals of Atmega32u4, and their state.
#pragma once

#include <simavr/sim_avr.h>

#include <cstdint>
#include <functional>
#include <memory>
#include <optional>
#include <type_traits>
#include <utility>
#include <vector>

#include "host/emulator/atmega32u4.h"

namespace torquer::emulator {

// Data space addresses.
inline constexpr int kEecr = 0x3f, kEedr = 0x40, kEearl = 0x41, kEearh = 0x42;
inline constexpr int kPllcsr = 0x49;
inline constexpr int kSpcr = 0x4c, kSpsr = 0x4d, kSpdr = 0x4e;
inline constexpr int kSmcr = 0x53, kMcusr = 0x54, kMcucr = 0x55, kWdtcsr = 0x60, kClkpr = 0x61;
inline constexpr int kAdcsra = 0x7a, kAdmux = 0x7c, kTccr1b = 0x81;

inline constexpr std::uint8_t kPowerOnReset = 1;  // of MCUSR

struct Atmega32u4::Hooks {
  explicit Hooks(Atmega32u4& owner) : chip(owner) {
    // The chip's own modules are reset after this one; AfterReset() comes when all are.
    io.kind = "torquer";
    io.reset = &OnReset;
  }

  static Hooks& From(void* parameter) { return *static_cast<Hooks*>(parameter); }

  static void OnReset(avr_io_t* io);
  static avr_cycle_count_t OnResetDone(avr_t*, avr_cycle_count_t, void* parameter);

  // Sleep: time passes at once; the cycles are counted.
  static void OnSleep(avr_t* avr, avr_cycle_count_t cycles);

  // USB.
  static std::uint8_t ReadUsb(avr_t*, avr_io_addr_t address, void* parameter);
  static void WriteUsb(avr_t* avr, avr_io_addr_t address, std::uint8_t value, void* parameter);
  // The requests are levels: a handler that leaves its flag up is called again.
  static void OnInterruptRunning(avr_irq_t*, std::uint32_t running, void* parameter);
  static void WritePll(avr_t* avr, avr_io_addr_t address, std::uint8_t value, void* parameter);

  // SPI, at the speed of its clock.
  static void WriteSpiData(avr_t* avr, avr_io_addr_t address, std::uint8_t value, void* parameter);
  static avr_cycle_count_t OnSpiDone(avr_t* avr, avr_cycle_count_t, void* parameter);
  static std::uint8_t ReadSpiData(avr_t* avr, avr_io_addr_t, void* parameter);

  // EEPROM, with the time that a write takes.
  static void WriteEepromControl(avr_t* avr, avr_io_addr_t address, std::uint8_t value,
                                 void* parameter);
  static avr_cycle_count_t OnEepromWindowEnd(avr_t* avr, avr_cycle_count_t, void*);
  static avr_cycle_count_t OnEepromWritten(avr_t* avr, avr_cycle_count_t, void* parameter);
  void FinishEepromWrite();

  // Watchdog: a change of the period alone starts it again.
  static void WriteWatchdog(avr_t* avr, avr_io_addr_t address, std::uint8_t value, void* parameter);

  // JTAG, which has four pins of port F until it is disabled by two writes within four cycles.
  static void WriteMcuControl(avr_t* avr, avr_io_addr_t address, std::uint8_t value,
                              void* parameter);
  static void WriteClockPrescaler(avr_t* avr, avr_io_addr_t address, std::uint8_t value,
                                  void* parameter);
  static void WriteAdcMux(avr_t* avr, avr_io_addr_t address, std::uint8_t value, void* parameter);

  // ADC: simavr's, until it is dead.
  static std::uint8_t ReadAdcControl(avr_t* avr, avr_io_addr_t address, void* parameter);

  // An interrupt of the watchdog's that is not served in its time is a reset.
  void FollowWatchdogInterrupt(avr_t* avr);

  // Again a moment later: a chip that falls asleep in this very cycle must not sleep on.
  static avr_cycle_count_t OnStop(avr_t*, avr_cycle_count_t when, void*);

  void Replace(avr_t* avr, int address, avr_io_read_t read, avr_io_write_t write);

  avr_io_t io{};  // first, for OnReset
  Atmega32u4& chip;
  avr_int_vector_t* usb_general = nullptr;
  avr_int_vector_t* usb_endpoint = nullptr;
  avr_int_vector_t* watchdog = nullptr;
  double watchdog_pending_us = -1;  // since when
  std::remove_reference_t<decltype(avr_t::io[0])> stock_watchdog{};
  std::remove_reference_t<decltype(avr_t::io[0])> stock_adc{};
  std::optional<avr_cycle_count_t> prescaler_asked_cycle;  // CLKPCE was written then
  bool jtag_asked = false;                                 // by a write to MCUCR
  std::uint8_t jtag_asked_for = 0;
  avr_cycle_count_t jtag_asked_cycle = 0;
  std::vector<std::unique_ptr<std::pair<Hooks*, std::function<void(bool, double)>>>> pin_listeners;
  SpiExchange exchange;
  bool spi_busy = false;
  std::uint8_t spi_received = 0xff;
  int eeprom_cell = -1;  // being written
  std::uint8_t eeprom_value = 0;
  std::uint8_t reset_cause = kPowerOnReset;
};

}  // namespace torquer::emulator
