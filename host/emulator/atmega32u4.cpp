#include "host/emulator/atmega32u4.h"

#include <simavr/avr_adc.h>
#include <simavr/avr_extint.h>
#include <simavr/avr_ioport.h>
#include <simavr/sim_avr.h>
#include <simavr/sim_time.h>

#include <algorithm>
#include <cmath>
#include <cstdarg>
#include <cstring>
#include <mutex>
#include <stdexcept>
#include <utility>

#include "host/emulator/atmega32u4_hooks.h"

#if defined(__SANITIZE_ADDRESS__)
// libsimavr frees only a part of a chip's memory. Visible: the sanitizer is a shared library.
extern "C" [[gnu::visibility("default")]] const char* __lsan_default_suppressions() {
  return "leak:libsimavr\n";
}
#endif

namespace torquer::emulator {
namespace {

// Data space addresses, and vectors.
constexpr int kUsbControl = 0xd8;
constexpr int kFirstRam = 0x100, kLastRam = 0xaff;
constexpr int kVectorUsbGeneral = 10, kVectorUsbEndpoint = 11, kVectorWatchdog = 12;

constexpr std::uint8_t kDividedBy8 = 3;  // CLKPR of a chip as it is sold
constexpr std::uint8_t kPinReset = 2, kBrownOutReset = 4, kWatchdogReset = 8;

void DiscardLog(avr_t*, int, const char*, va_list) {}

// After a reset, libsimavr checks each low pin of an external interrupt in every cycle. While a
// button is held this takes more than one core. The firmware has no level interrupts, so edges
// suffice.
void DoNotPollPins(avr_t* avr) {
  for (std::uint8_t k = 0; k < EXTINT_COUNT; ++k) avr_extint_set_strict_lvl_trig(avr, k, 0);
}

}  // namespace

Atmega32u4::Atmega32u4(const FirmwareImage& image, const std::vector<std::uint8_t>& eeprom,
                       std::uint32_t seed, double supply_mv)
    : hooks_(std::make_unique<Hooks>(*this)),
      eeprom_(eeprom),
      supply_mv_(supply_mv),
      noise_(seed * 2654435761u | 1) {
  eeprom_.resize(kEepromBytes, 0xff);
  static std::once_flag log_silenced;
  std::call_once(log_silenced, [] { avr_global_logger_set(&DiscardLog); });

  avr_ = avr_make_mcu_by_name("atmega32u4");
  if (!avr_) throw std::runtime_error("libsimavr does not support the atmega32u4");
  avr_init(avr_);
  avr_->custom.data = hooks_.get();
  avr_->log = LOG_NONE;
  avr_->frequency = image.cpu_hz();
  cpu_mhz_ = image.cpu_hz() / 1e6;
  crystal_mhz_ = image.crystal_hz() / 1e6;
  avr_->vcc = avr_->avcc = avr_->aref = static_cast<std::uint32_t>(std::lround(supply_mv_));
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
    vector->enable = avr_regbit_t AVR_IO_REGBIT(kUsbControl, 7);
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
  flash_ = std::make_unique<FlashMemory>(avr_, cpu_mhz_, image.boot_start(), noise_,
                                         [this](const std::string& what) { Violation(what); });
  hooks_->stock_watchdog = avr_->io[AVR_DATA_TO_IO(kWdtcsr)];
  hooks_->Replace(avr_, kWdtcsr, nullptr, &Hooks::WriteWatchdog);
  hooks_->stock_adc = avr_->io[AVR_DATA_TO_IO(kAdcsra)];
  hooks_->Replace(avr_, kAdcsra, &Hooks::ReadAdcControl, nullptr);
  hooks_->Replace(avr_, kMcucr, nullptr, &Hooks::WriteMcuControl);
  hooks_->Replace(avr_, kClkpr, nullptr, &Hooks::WriteClockPrescaler);
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
  // The replaced modules must not free memory of this object, so it leaves the module list.
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
  avr_->data[kClkpr] = kDividedBy8;
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

void Atmega32u4::SetDead(Peripheral peripheral) {
  dead_ = peripheral;
  if (peripheral == Peripheral::kUsbMemory) usb_.ExhaustMemory();
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

double Atmega32u4::now_us() const { return static_cast<double>(avr_->cycle) / cpu_mhz_; }

void Atmega32u4::RunUntil(double us) {
  const auto end = static_cast<avr_cycle_count_t>(us * cpu_mhz_);
  if (end <= avr_->cycle) return;
  // The CPU runs on until an interrupt or the next timer. By default simavr looks for these after
  // each instruction.
  avr_->run_cycle_limit = end - avr_->cycle;
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

std::uint32_t Atmega32u4::StepInstruction() {
  RunUntil(now_us() + 1.5 / cpu_mhz_);
  return avr_->pc;
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
  const double millivolts = std::clamp(fraction, 0.0, 1.0) * supply_mv_;
  avr_raise_irq(avr_io_getirq(avr_, AVR_IOCTL_ADC_GETIRQ, channel),
                static_cast<std::uint32_t>(std::lround(millivolts)));
}

std::vector<std::uint8_t> Atmega32u4::EepromAfterPowerLoss() {
  std::vector<std::uint8_t> left = eeprom_;
  if (hooks_->eeprom_cell >= 0) {
    // A write erases to 0xff, then clears bits. A loss of power may leave any of these bits set.
    noise_ = noise_ * 1664525u + 1013904223u;
    left[static_cast<std::size_t>(hooks_->eeprom_cell)] =
        static_cast<std::uint8_t>(hooks_->eeprom_value | (noise_ >> 24));
  }
  return left;
}

int Atmega32u4::EepromCellBeingWritten() const { return hooks_->eeprom_cell; }

}  // namespace torquer::emulator
