#include "host/emulator/atmega32u4.h"

#include <simavr/avr_adc.h>
#include <simavr/avr_extint.h>
#include <simavr/avr_ioport.h>
#include <simavr/avr_spi.h>
#include <simavr/avr_watchdog.h>
#include <simavr/sim_avr.h>
#include <simavr/sim_time.h>

#include <algorithm>
#include <cmath>
#include <cstdarg>
#include <cstring>
#include <mutex>
#include <stdexcept>
#include <utility>

#if defined(__SANITIZE_ADDRESS__)
// libsimavr frees little of what a chip has allocated. Visible: the sanitizer is a shared library.
extern "C" [[gnu::visibility("default")]] const char* __lsan_default_suppressions() {
  return "leak:libsimavr\n";
}
#endif

namespace torquer::emulator {
namespace {

// Data space addresses.
constexpr int kEecr = 0x3f, kEedr = 0x40, kEearl = 0x41, kEearh = 0x42;
constexpr int kPllcsr = 0x49;
constexpr int kSpcr = 0x4c, kSpsr = 0x4d, kSpdr = 0x4e;
constexpr int kSmcr = 0x53, kMcusr = 0x54, kMcucr = 0x55, kWdtcsr = 0x60;
constexpr int kAdcsra = 0x7a, kAdmux = 0x7c, kTccr1b = 0x81;
constexpr int kFirstRam = 0x100, kLastRam = 0xaff;
constexpr int kUsbcon = 0xd8;
constexpr int kVectorUsbGeneral = 10, kVectorUsbEndpoint = 11, kVectorWatchdog = 12;

constexpr std::uint8_t kPowerOnReset = 1, kPinReset = 2, kBrownOutReset = 4, kWatchdogReset = 8;
constexpr int kSupplyMillivolts = 5000;
constexpr double kEepromWriteUs = 3400;

void DiscardLog(avr_t*, int, const char*, va_list) {}

// A reset makes libsimavr look at every pin of an external interrupt that is low once a cycle,
// which takes more than a core while a button is held. The firmware has no such interrupt: edges
// do.
void DoNotPollPins(avr_t* avr) {
  for (std::uint8_t k = 0; k < EXTINT_COUNT; ++k) avr_extint_set_strict_lvl_trig(avr, k, 0);
}

}  // namespace

struct Atmega32u4::Hooks {
  explicit Hooks(Atmega32u4& owner) : chip(owner) {
    // The chip's own modules are reset after this one; AfterReset() comes when all are.
    io.kind = "torquer";
    io.reset = &OnReset;
  }

  static Hooks& From(void* parameter) { return *static_cast<Hooks*>(parameter); }

  static void OnReset(avr_io_t* io) {
    Hooks& hooks = *reinterpret_cast<Hooks*>(io);
    avr_cycle_timer_register(io->avr, 1, &OnResetDone, &hooks);
  }
  static avr_cycle_count_t OnResetDone(avr_t*, avr_cycle_count_t, void* parameter) {
    From(parameter).chip.AfterReset();
    return 0;
  }

  // --- sleep: time passes at once; the cycles are counted
  // -----------------------------------------
  static void OnSleep(avr_t* avr, avr_cycle_count_t cycles) {
    auto* hooks = static_cast<Hooks*>(avr->custom.data);
    hooks->chip.sleep_cycles_ += cycles + 1;
  }

  // --- USB --------------------------------------------------------------------------------------
  static std::uint8_t ReadUsb(avr_t*, avr_io_addr_t address, void* parameter) {
    return From(parameter).chip.usb_.Read(address);
  }
  static void WriteUsb(avr_t* avr, avr_io_addr_t address, std::uint8_t value, void* parameter) {
    avr->data[address] = value;
    Hooks& hooks = From(parameter);
    hooks.chip.usb_.Write(address, value);
    hooks.chip.UpdateUsbInterrupts();
  }
  // The requests are levels: a handler that leaves its flag up is called again.
  static void OnInterruptRunning(avr_irq_t*, std::uint32_t running, void* parameter) {
    if (!running) From(parameter).chip.UpdateUsbInterrupts();
  }
  static void WritePll(avr_t* avr, avr_io_addr_t address, std::uint8_t value, void* parameter) {
    constexpr std::uint8_t kLock = 0x01, kEnable = 0x02, kInputDivider = 0x10;
    Atmega32u4& chip = From(parameter).chip;
    const bool enabled = value & kEnable;
    const bool divider_fits = ((value & kInputDivider) != 0) == (chip.clock_mhz_ == 16);
    if (enabled && !divider_fits) {
      chip.Violation("PLLCSR: the divider does not fit the crystal, the USB has no 48 MHz");
    }
    const bool locked = enabled && divider_fits && chip.dead_ != Part::kPll;
    avr->data[address] = static_cast<std::uint8_t>((value & ~kLock) | (locked ? kLock : 0));
    chip.usb_.SetPllLocked(locked);
  }

  // --- SPI, at the speed of its clock
  // -------------------------------------------------------------
  static void WriteSpiData(avr_t* avr, avr_io_addr_t address, std::uint8_t value, void* parameter) {
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
    hooks.exchange = {value, start_us, start_us + 8 * divider / hooks.chip.clock_mhz_,
                      hooks.chip.clock_mhz_ * 1e6 / divider, (control >> 2) & 3};
    hooks.spi_busy = true;
    avr_cycle_timer_register(avr, static_cast<avr_cycle_count_t>(8 * divider), &OnSpiDone, &hooks);
  }
  static avr_cycle_count_t OnSpiDone(avr_t* avr, avr_cycle_count_t, void* parameter) {
    Hooks& hooks = From(parameter);
    if (hooks.chip.dead_ == Part::kSpi) return 0;
    hooks.spi_busy = false;
    hooks.spi_received =
        hooks.chip.spi_slave_ ? hooks.chip.spi_slave_(hooks.exchange) : std::uint8_t{0xff};
    avr->data[kSpsr] |= 0x80;
    return 0;
  }
  static std::uint8_t ReadSpiData(avr_t* avr, avr_io_addr_t, void* parameter) {
    avr->data[kSpsr] &= 0x7f;
    return From(parameter).spi_received;
  }

  // --- EEPROM, with the time that a write takes
  // ---------------------------------------------------
  static void WriteEepromControl(avr_t* avr, avr_io_addr_t address, std::uint8_t value,
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
      avr_cycle_timer_register(
          avr, static_cast<avr_cycle_count_t>(kEepromWriteUs * hooks.chip.clock_mhz_),
          &OnEepromWritten, &hooks);
      return;
    }
    if (value & kRead) avr->data[kEedr] = hooks.chip.eeprom_[static_cast<std::size_t>(cell)];
    avr->data[address] = static_cast<std::uint8_t>(value & ~(kRead | kProgram));
    if (value & kMasterProgram) avr_cycle_timer_register(avr, 5, &OnEepromWindowEnd, &hooks);
  }
  static avr_cycle_count_t OnEepromWindowEnd(avr_t* avr, avr_cycle_count_t, void*) {
    avr->data[kEecr] &= static_cast<std::uint8_t>(~0x04);
    return 0;
  }
  static avr_cycle_count_t OnEepromWritten(avr_t* avr, avr_cycle_count_t, void* parameter) {
    if (From(parameter).chip.dead_ == Part::kEeprom) return 0;
    From(parameter).FinishEepromWrite();
    avr->data[kEecr] &= static_cast<std::uint8_t>(~0x02);
    return 0;
  }
  void FinishEepromWrite() {
    if (eeprom_cell < 0) return;
    chip.eeprom_[static_cast<std::size_t>(eeprom_cell)] = eeprom_value;
    eeprom_cell = -1;
  }

  // --- watchdog: a change of the period alone starts it again
  // --------------------------------------
  static void WriteWatchdog(avr_t* avr, avr_io_addr_t address, std::uint8_t value,
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

  // --- JTAG, which has four pins of port F until it is disabled by two writes within four cycles
  // --
  static void WriteMcuControl(avr_t* avr, avr_io_addr_t address, std::uint8_t value,
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
  static void WriteAdcMux(avr_t* avr, avr_io_addr_t address, std::uint8_t value, void* parameter) {
    constexpr std::uint8_t kChannel = 0x1f, kFirstOfJtag = 4, kLastOfJtag = 7, kJtagDisable = 0x80;
    Hooks& hooks = From(parameter);
    const int channel = value & kChannel;
    if (channel >= kFirstOfJtag && channel <= kLastOfJtag && !(avr->data[kMcucr] & kJtagDisable)) {
      hooks.chip.Violation("ADMUX: ADC4 to ADC7 are JTAG's pins until JTD disables that");
    }
    avr->data[address] = value;
  }

  // --- ADC: simavr's, until it is dead ----------------------------------------------------------
  static std::uint8_t ReadAdcControl(avr_t* avr, avr_io_addr_t address, void* parameter) {
    constexpr std::uint8_t kEnable = 0x80, kConverting = 0x40;
    const Hooks& hooks = From(parameter);
    const std::uint8_t value = hooks.stock_adc.r.c
                                   ? hooks.stock_adc.r.c(avr, address, hooks.stock_adc.r.param)
                                   : avr->data[address];
    const bool dead = hooks.chip.dead_ == Part::kAdc && (value & kEnable);
    return static_cast<std::uint8_t>(value | (dead ? kConverting : 0));
  }

  // An interrupt of the watchdog's that is not served in its time is a reset.
  void FollowWatchdogInterrupt(avr_t* avr) {
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

  // Again a moment later: a chip that falls asleep in this very cycle must not sleep on.
  static avr_cycle_count_t OnStop(avr_t*, avr_cycle_count_t when, void*) { return when + 64; }

  void Replace(avr_t* avr, int address, avr_io_read_t read, avr_io_write_t write) {
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

  avr_io_t io{};  // first, for OnReset
  Atmega32u4& chip;
  avr_int_vector_t* usb_general = nullptr;
  avr_int_vector_t* usb_endpoint = nullptr;
  avr_int_vector_t* watchdog = nullptr;
  double watchdog_pending_us = -1;  // since when
  std::remove_reference_t<decltype(avr_t::io[0])> stock_watchdog{};
  std::remove_reference_t<decltype(avr_t::io[0])> stock_adc{};
  bool jtag_asked = false;  // by a write to MCUCR
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

Atmega32u4::Atmega32u4(const FirmwareImage& image, const std::vector<std::uint8_t>& eeprom,
                       std::uint32_t seed)
    : hooks_(std::make_unique<Hooks>(*this)), eeprom_(eeprom), noise_(seed * 2654435761u | 1) {
  eeprom_.resize(kEepromBytes, 0xff);
  static std::once_flag log_silenced;
  std::call_once(log_silenced, [] { avr_global_logger_set(&DiscardLog); });

  avr_ = avr_make_mcu_by_name("atmega32u4");
  if (!avr_) throw std::runtime_error("libsimavr knows no atmega32u4");
  avr_init(avr_);
  avr_->custom.data = hooks_.get();
  avr_->log = LOG_NONE;
  avr_->frequency = image.clock_hz();
  clock_mhz_ = image.clock_hz() / 1e6;
  avr_->vcc = avr_->avcc = avr_->aref = kSupplyMillivolts;
  avr_->sleep = &Hooks::OnSleep;
  std::copy(image.flash().begin(), image.flash().end(), avr_->flash);
  avr_->codeend = static_cast<std::uint32_t>(image.flash().size());
  avr_->reset_pc = image.boot_start();

  for (int i = 0; i < avr_->interrupts.vector_count; ++i) {
    avr_int_vector_t* vector = avr_->interrupts.vector[i];
    if (vector->vector == kVectorUsbGeneral) hooks_->usb_general = vector;
    if (vector->vector == kVectorUsbEndpoint) hooks_->usb_endpoint = vector;
    if (vector->vector == kVectorWatchdog) hooks_->watchdog = vector;
  }
  for (avr_int_vector_t* vector : {hooks_->usb_general, hooks_->usb_endpoint}) {
    // The controller handles masks; simavr must serve every requested interrupt.
    vector->enable = avr_regbit_t AVR_IO_REGBIT(kUsbcon, 7);
    avr_irq_register_notify(vector->irq + AVR_INT_IRQ_RUNNING, &Hooks::OnInterruptRunning,
                            hooks_.get());
  }

  for (int address = UsbController::kFirstRegister; address <= UsbController::kLastRegister;
       ++address) {
    hooks_->Replace(avr_, address, &Hooks::ReadUsb, &Hooks::WriteUsb);
  }
  hooks_->Replace(avr_, kPllcsr, nullptr, &Hooks::WritePll);
  hooks_->Replace(avr_, kSpdr, &Hooks::ReadSpiData, &Hooks::WriteSpiData);
  hooks_->Replace(avr_, kEecr, nullptr, &Hooks::WriteEepromControl);
  flash_ = std::make_unique<FlashMemory>(avr_, clock_mhz_, image.boot_start(), noise_,
                                         [this](const std::string& what) { Violation(what); });
  hooks_->stock_watchdog = avr_->io[AVR_DATA_TO_IO(kWdtcsr)];
  hooks_->Replace(avr_, kWdtcsr, nullptr, &Hooks::WriteWatchdog);
  hooks_->stock_adc = avr_->io[AVR_DATA_TO_IO(kAdcsra)];
  hooks_->Replace(avr_, kAdcsra, &Hooks::ReadAdcControl, nullptr);
  hooks_->Replace(avr_, kMcucr, nullptr, &Hooks::WriteMcuControl);
  hooks_->Replace(avr_, kAdmux, nullptr, &Hooks::WriteAdcMux);

  for (int address = kFirstRam; address <= kLastRam; ++address) {
    noise_ = noise_ * 1664525u + 1013904223u;
    avr_->data[address] = static_cast<std::uint8_t>(noise_ >> 24);
  }
  avr_register_io(avr_, &hooks_->io);
  avr_reset(avr_);
  DoNotPollPins(avr_);
}

Atmega32u4::~Atmega32u4() {
  if (!avr_) return;
  // The replaced modules free nothing of ours; the module list must not reach into this object.
  avr_->custom.data = nullptr;
  avr_terminate(avr_);
  std::free(avr_);
}

void Atmega32u4::AfterReset() {
  DoNotPollPins(avr_);
  if (hooks_->reset_cause == kWatchdogReset) ++resets_;
  avr_->data[kMcusr] = hooks_->reset_cause;
  hooks_->reset_cause = kWatchdogReset;  // unless set otherwise, the next one is the watchdog's
  hooks_->spi_busy = false;
  hooks_->FinishEepromWrite();
  flash_->Reset();
  usb_.Reset();
  // The pins' register was cleared, and simavr passes no level on that it takes for an old one.
  const auto levels = pins_;
  for (const auto& [pin, high] : levels) {
    SetPin(pin.first, pin.second, !high);
    SetPin(pin.first, pin.second, high);
  }
  for (const auto& [channel, fraction] : analog_) SetAnalog(channel, fraction);
}

void Atmega32u4::ResetFor(std::uint8_t cause) {
  ++resets_;
  hooks_->reset_cause = cause;
  avr_reset(avr_);
}

void Atmega32u4::ResetByPin() { ResetFor(kPinReset); }

void Atmega32u4::ResetByBrownOut() {
  eeprom_ = EepromAfterPowerLoss();
  hooks_->eeprom_cell = -1;
  ResetFor(kBrownOutReset);
}

void Atmega32u4::SetDead(Part part) {
  dead_ = part;
  if (part == Part::kUsbMemory) usb_.ExhaustMemory();
}

std::vector<std::string> Atmega32u4::PartsAwake() const {
  constexpr std::uint8_t kModes = 0x0e, kPowerDown = 0x04, kAdcEnable = 0x80, kClockSelect = 0x07;
  std::vector<std::string> awake;
  const bool asleep = avr_->state == cpu_Sleeping && (avr_->data[kSmcr] & kModes) == kPowerDown;
  if (!asleep) awake.emplace_back("CPU");
  if (avr_->data[kAdcsra] & kAdcEnable) awake.emplace_back("ADC");
  if (avr_->data[kTccr1b] & kClockSelect) awake.emplace_back("timer 1");
  if (usb_.Runs()) awake.emplace_back("USB");
  return awake;
}

void Atmega32u4::Violation(const std::string& what) {
  constexpr std::size_t kKept = 100;
  if (violations_.size() < kKept) violations_.push_back(what);
}

std::vector<std::string> Atmega32u4::Violations() const {
  std::vector<std::string> all = violations_;
  all.insert(all.end(), usb_.violations().begin(), usb_.violations().end());
  return all;
}

std::uint64_t Atmega32u4::cycles() const { return avr_->cycle; }

double Atmega32u4::now_us() const { return static_cast<double>(avr_->cycle) / clock_mhz_; }

void Atmega32u4::RunUntil(double us) {
  const auto end = static_cast<avr_cycle_count_t>(us * clock_mhz_);
  if (end <= avr_->cycle) return;
  // Without a timer at the end, a sleeping chip would jump past it to its own next one.
  avr_cycle_timer_register(avr_, end - avr_->cycle, &Hooks::OnStop, hooks_.get());
  while (avr_->cycle < end) {
    const int state = avr_run(avr_);
    if (state == cpu_Done || state == cpu_Crashed) {
      throw std::runtime_error(
          "the emulated CPU stopped for good: it sleeps with interrupts off, "
          "or left its program");
    }
  }
  hooks_->FollowWatchdogInterrupt(avr_);
}

void Atmega32u4::UpdateUsbInterrupts() {
  const std::pair<avr_int_vector_t*, bool> requests[] = {
      {hooks_->usb_general, usb_.general_interrupt()},
      {hooks_->usb_endpoint, usb_.endpoint_interrupt()}};
  for (const auto& [vector, requested] : requests) {
    if (requested && !vector->pending) avr_raise_interrupt(avr_, vector);
    if (!requested && vector->pending) avr_clear_interrupt(avr_, vector);
  }
}

void Atmega32u4::SetPin(char port, int bit, bool high) {
  pins_[{port, bit}] = high;
  avr_raise_irq(avr_io_getirq(avr_, AVR_IOCTL_IOPORT_GETIRQ(port), bit), high);
}

std::optional<bool> Atmega32u4::DrivenLevel(char port, int bit) const {
  // PINx, DDRx and PORTx of port B are at 0x23; those of each further port follow.
  const int pin_register = 0x23 + 3 * (port - 'B');
  const int mask = 1 << bit;
  if (!(avr_->data[pin_register + 1] & mask)) return std::nullopt;
  return (avr_->data[pin_register + 2] & mask) != 0;
}

void Atmega32u4::OnPin(char port, int bit, std::function<void(bool, double)> changed) {
  using Listener = std::pair<Hooks*, std::function<void(bool, double)>>;
  hooks_->pin_listeners.push_back(std::make_unique<Listener>(hooks_.get(), std::move(changed)));
  avr_irq_register_notify(
      avr_io_getirq(avr_, AVR_IOCTL_IOPORT_GETIRQ(port), bit),
      [](avr_irq_t*, std::uint32_t level, void* parameter) {
        auto& listener = *static_cast<Listener*>(parameter);
        listener.second(level != 0, listener.first->chip.now_us());
      },
      hooks_->pin_listeners.back().get());
}

void Atmega32u4::SetAnalog(int channel, double fraction) {
  analog_[channel] = fraction;
  const double millivolts = std::clamp(fraction, 0.0, 1.0) * kSupplyMillivolts;
  avr_raise_irq(avr_io_getirq(avr_, AVR_IOCTL_ADC_GETIRQ, channel),
                static_cast<std::uint32_t>(std::lround(millivolts)));
}

std::vector<std::uint8_t> Atmega32u4::EepromAfterPowerLoss() {
  std::vector<std::uint8_t> left = eeprom_;
  if (hooks_->eeprom_cell >= 0) {
    // A write erases to 0xff, then clears bits: any of them may have been left out.
    noise_ = noise_ * 1664525u + 1013904223u;
    left[static_cast<std::size_t>(hooks_->eeprom_cell)] =
        static_cast<std::uint8_t>(hooks_->eeprom_value | (noise_ >> 24));
  }
  return left;
}

int Atmega32u4::EepromCellBeingWritten() const { return hooks_->eeprom_cell; }

}  // namespace torquer::emulator
