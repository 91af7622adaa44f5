#include "host/emulator/atmega32u4_hooks.h"

#include <simavr/avr_watchdog.h>
#include <simavr/sim_time.h>

#include <cstddef>
#include <string>

namespace torquer::emulator {
namespace {

constexpr double kEepromWriteUs = 3400;

}  // namespace

void Atmega32u4::Hooks::OnReset(avr_io_t* io) {
  Hooks& hooks = *reinterpret_cast<Hooks*>(io);
  avr_cycle_timer_register(io->avr, 1, &OnResetDone, &hooks);
}

avr_cycle_count_t Atmega32u4::Hooks::OnResetDone(avr_t*, avr_cycle_count_t, void* parameter) {
  From(parameter).chip.AfterReset();
  return 0;
}

void Atmega32u4::Hooks::OnSleep(avr_t* avr, avr_cycle_count_t cycles) {
  auto* hooks = static_cast<Hooks*>(avr->custom.data);
  hooks->chip.sleep_cycles_ += cycles + 1;
}

std::uint8_t Atmega32u4::Hooks::ReadUsb(avr_t*, avr_io_addr_t address, void* parameter) {
  return From(parameter).chip.usb_.Read(address);
}

void Atmega32u4::Hooks::WriteUsb(avr_t* avr, avr_io_addr_t address, std::uint8_t value,
                                 void* parameter) {
  avr->data[address] = value;
  Hooks& hooks = From(parameter);
  hooks.chip.usb_.Write(address, value);
  hooks.chip.UpdateUsbInterrupts();
}

void Atmega32u4::Hooks::OnInterruptRunning(avr_irq_t*, std::uint32_t running, void* parameter) {
  if (!running) From(parameter).chip.UpdateUsbInterrupts();
}

void Atmega32u4::Hooks::WritePll(avr_t* avr, avr_io_addr_t address, std::uint8_t value,
                                 void* parameter) {
  constexpr std::uint8_t kLock = 0x01, kEnable = 0x02, kInputDivider = 0x10;
  Atmega32u4& chip = From(parameter).chip;
  const bool enabled = value & kEnable;
  const bool divider_fits = ((value & kInputDivider) != 0) == (chip.crystal_mhz_ == 16);
  if (enabled && !divider_fits) {
    chip.Violation("PLLCSR: the divider does not fit the crystal, the USB has no 48 MHz");
  }
  const int divider = 1 << (avr->data[kClkpr] & 0x0f);
  if (enabled && chip.crystal_mhz_ / divider != chip.cpu_mhz_) {
    chip.Violation("CLKPR: the crystal's clock is divided by " + std::to_string(divider) +
                   ", so the CPU does not run at the image's clock");
  }
  const bool locked = enabled && divider_fits && chip.dead_ != Peripheral::kPll;
  avr->data[address] = static_cast<std::uint8_t>((value & ~kLock) | (locked ? kLock : 0));
  chip.usb_.SetPllLocked(locked);
}

void Atmega32u4::Hooks::WriteSpiData(avr_t* avr, avr_io_addr_t address, std::uint8_t value,
                                     void* parameter) {
  constexpr std::uint8_t kEnable = 0x40, kMaster = 0x10;
  constexpr std::uint8_t kDone = 0x80, kDouble = 0x01;
  Hooks& hooks = From(parameter);
  const std::uint8_t control = avr->data[kSpcr];
  if (!(control & kEnable) || !(control & kMaster)) {
    hooks.chip.Violation("SPDR written while the SPI is off or not master");
    return;
  }
  if (hooks.spi_busy) {
    hooks.chip.Violation("SPDR written during a transfer");
    return;
  }
  avr->data[address] = value;
  avr->data[kSpsr] &= static_cast<std::uint8_t>(~kDone);
  constexpr int kDividers[] = {4, 16, 64, 128};
  const int divider = kDividers[control & 3] / (avr->data[kSpsr] & kDouble ? 2 : 1);
  const double start_us = hooks.chip.now_us();
  hooks.exchange = {value, start_us, start_us + 8 * divider / hooks.chip.cpu_mhz_,
                    hooks.chip.cpu_mhz_ * 1e6 / divider, (control >> 2) & 3};
  hooks.spi_busy = true;
  avr_cycle_timer_register(avr, static_cast<avr_cycle_count_t>(8 * divider), &OnSpiDone, &hooks);
}

avr_cycle_count_t Atmega32u4::Hooks::OnSpiDone(avr_t* avr, avr_cycle_count_t, void* parameter) {
  Hooks& hooks = From(parameter);
  if (hooks.chip.dead_ == Peripheral::kSpi) return 0;
  hooks.spi_busy = false;
  hooks.spi_received =
      hooks.chip.spi_slave_ ? hooks.chip.spi_slave_(hooks.exchange) : std::uint8_t{0xff};
  avr->data[kSpsr] |= 0x80;
  return 0;
}

std::uint8_t Atmega32u4::Hooks::ReadSpiData(avr_t* avr, avr_io_addr_t, void* parameter) {
  avr->data[kSpsr] &= 0x7f;
  return From(parameter).spi_received;
}

void Atmega32u4::Hooks::WriteEepromControl(avr_t* avr, avr_io_addr_t address, std::uint8_t value,
                                           void* parameter) {
  constexpr std::uint8_t kRead = 0x01, kProgram = 0x02, kMasterProgram = 0x04, kModes = 0x30;
  Hooks& hooks = From(parameter);
  const std::uint8_t old = avr->data[address];
  const int cell = ((avr->data[kEearh] << 8) | avr->data[kEearl]) % kEepromBytes;
  if (hooks.eeprom_cell >= 0) {
    if (value & kRead) hooks.chip.Violation("EEPROM read during a write");
    avr->data[address] = static_cast<std::uint8_t>((value & ~kRead) | kProgram);
    return;
  }
  if ((value & kProgram) && (old & kMasterProgram)) {
    if (value & kModes) hooks.chip.Violation("EEPROM mode other than erase-and-write");
    hooks.eeprom_cell = cell;
    hooks.eeprom_value = avr->data[kEedr];
    ++hooks.chip.eeprom_writes_;
    avr->data[address] = kProgram;
    avr_cycle_timer_register(avr,
                             static_cast<avr_cycle_count_t>(kEepromWriteUs * hooks.chip.cpu_mhz_),
                             &OnEepromWritten, &hooks);
    return;
  }
  if (value & kRead) avr->data[kEedr] = hooks.chip.eeprom_[static_cast<std::size_t>(cell)];
  avr->data[address] = static_cast<std::uint8_t>(value & ~(kRead | kProgram));
  if (value & kMasterProgram) avr_cycle_timer_register(avr, 5, &OnEepromWindowEnd, &hooks);
}

avr_cycle_count_t Atmega32u4::Hooks::OnEepromWindowEnd(avr_t* avr, avr_cycle_count_t, void*) {
  avr->data[kEecr] &= static_cast<std::uint8_t>(~0x04);
  return 0;
}

avr_cycle_count_t Atmega32u4::Hooks::OnEepromWritten(avr_t* avr, avr_cycle_count_t,
                                                     void* parameter) {
  if (From(parameter).chip.dead_ == Peripheral::kEeprom) return 0;
  From(parameter).FinishEepromWrite();
  avr->data[kEecr] &= static_cast<std::uint8_t>(~0x02);
  return 0;
}

void Atmega32u4::Hooks::FinishEepromWrite() {
  if (eeprom_cell < 0) return;
  chip.eeprom_[static_cast<std::size_t>(eeprom_cell)] = eeprom_value;
  eeprom_cell = -1;
}

void Atmega32u4::Hooks::WriteWatchdog(avr_t* avr, avr_io_addr_t address, std::uint8_t value,
                                      void* parameter) {
  constexpr std::uint8_t kEnable = 0x08, kPeriod = 0x27;
  Hooks& hooks = From(parameter);
  const std::uint8_t old = avr->data[address];
  hooks.stock_watchdog.w.c(avr, address, value, hooks.stock_watchdog.w.param);
  const std::uint8_t now = avr->data[address];
  if ((now & kEnable) && ((old ^ now) & kPeriod)) {
    avr_ioctl(avr, AVR_IOCTL_WATCHDOG_RESET, nullptr);
  }
}

void Atmega32u4::Hooks::WriteMcuControl(avr_t* avr, avr_io_addr_t address, std::uint8_t value,
                                        void* parameter) {
  constexpr std::uint8_t kJtagDisable = 0x80;
  constexpr avr_cycle_count_t kWindow = 4;
  Hooks& hooks = From(parameter);
  const bool again = hooks.jtag_asked && avr->cycle - hooks.jtag_asked_cycle <= kWindow &&
                     hooks.jtag_asked_for == (value & kJtagDisable);
  hooks.jtag_asked = true;
  hooks.jtag_asked_for = value & kJtagDisable;
  hooks.jtag_asked_cycle = avr->cycle;
  const std::uint8_t old = avr->data[address] & kJtagDisable;
  avr->data[address] =
      static_cast<std::uint8_t>((value & ~kJtagDisable) | (again ? value & kJtagDisable : old));
}

void Atmega32u4::Hooks::WriteClockPrescaler(avr_t* avr, avr_io_addr_t address, std::uint8_t value,
                                            void* parameter) {
  constexpr std::uint8_t kChangeEnable = 0x80, kDivider = 0x0f;
  constexpr avr_cycle_count_t kWindow = 4;
  Hooks& hooks = From(parameter);
  if (value == kChangeEnable) {
    hooks.prescaler_asked_cycle = avr->cycle;
    return;
  }
  if (!hooks.prescaler_asked_cycle || avr->cycle - *hooks.prescaler_asked_cycle > kWindow) {
    hooks.chip.Violation("CLKPR written without CLKPCE alone within four cycles before");
    return;
  }
  hooks.prescaler_asked_cycle.reset();
  avr->data[address] = value & kDivider;
}

void Atmega32u4::Hooks::WriteAdcMux(avr_t* avr, avr_io_addr_t address, std::uint8_t value,
                                    void* parameter) {
  constexpr std::uint8_t kChannel = 0x1f, kFirstOfJtag = 4, kLastOfJtag = 7, kJtagDisable = 0x80;
  Hooks& hooks = From(parameter);
  const int channel = value & kChannel;
  if (channel >= kFirstOfJtag && channel <= kLastOfJtag && !(avr->data[kMcucr] & kJtagDisable)) {
    hooks.chip.Violation("ADMUX: ADC4 to ADC7 are JTAG's pins until JTD disables that");
  }
  avr->data[address] = value;
}

std::uint8_t Atmega32u4::Hooks::ReadAdcControl(avr_t* avr, avr_io_addr_t address, void* parameter) {
  constexpr std::uint8_t kEnable = 0x80, kConverting = 0x40;
  const Hooks& hooks = From(parameter);
  const std::uint8_t value = hooks.stock_adc.r.c
                                 ? hooks.stock_adc.r.c(avr, address, hooks.stock_adc.r.param)
                                 : avr->data[address];
  const bool dead = hooks.chip.dead_ == Peripheral::kAdc && (value & kEnable);
  return static_cast<std::uint8_t>(value | (dead ? kConverting : 0));
}

void Atmega32u4::Hooks::FollowWatchdogInterrupt(avr_t* avr) {
  const int scale = (avr->data[kWdtcsr] & 0x07) | ((avr->data[kWdtcsr] & 0x20) >> 2);
  const double period_us = 16000.0 * (1 << scale);
  if (!watchdog->pending) {
    watchdog_pending_us = -1;
  } else if (watchdog_pending_us < 0) {
    watchdog_pending_us = chip.now_us();
  } else if (chip.now_us() - watchdog_pending_us > period_us) {
    avr_reset(avr);
  }
}

avr_cycle_count_t Atmega32u4::Hooks::OnStop(avr_t*, avr_cycle_count_t when, void*) {
  return when + 64;
}

void Atmega32u4::Hooks::Replace(avr_t* avr, int address, avr_io_read_t read, avr_io_write_t write) {
  auto& handlers = avr->io[AVR_DATA_TO_IO(address)];
  if (read) {
    handlers.r.c = read;
    handlers.r.param = this;
  }
  if (write) {
    handlers.w.c = write;
    handlers.w.param = this;
  }
}

}  // namespace torquer::emulator
