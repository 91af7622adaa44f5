#include "host/emulator/flash_memory.h"

#include <simavr/avr_flash.h>
#include <simavr/sim_avr.h>
#include <simavr/sim_cycle_timers.h>
#include <simavr/sim_io.h>

#include <algorithm>
#include <cstring>
#include <utility>

namespace torquer::emulator {
namespace {

constexpr int kSpmcsr = 0x57, kEepromControl = 0x3f;
constexpr std::uint8_t kSpmen = 0x01, kPgers = 0x02, kPgwrt = 0x04, kRwwsre = 0x10, kSigrd = 0x20,
                       kRwwsb = 0x40;
constexpr std::uint8_t kCommand = 0x3f;
constexpr std::uint8_t kEepromBusy = 0x02;
// Between SPMEN and the instruction, its cycles included.
constexpr int kWindowCycles = 5;

}  // namespace

struct FlashMemory::Hooks {
  static FlashMemory& From(void* parameter) { return *static_cast<FlashMemory*>(parameter); }

  static void WriteControl(avr_t*, avr_io_addr_t, std::uint8_t value, void* parameter) {
    From(parameter).WriteControl(value);
  }
  // simavr's module calls this for SPM; the control register's handler knows where we are.
  static int Ioctl(avr_io_t* io, std::uint32_t control, void*) {
    if (control != AVR_IOCTL_FLASH_SPM) return -1;
    From(io->avr->io[AVR_DATA_TO_IO(kSpmcsr)].w.param).Spm();
    return 0;
  }
  static avr_cycle_count_t OnWindowEnd(avr_t* avr, avr_cycle_count_t, void* parameter) {
    FlashMemory& flash = From(parameter);
    if (flash.signature_shown_) flash.EndSignature();
    if (flash.operation_ == Operation::kNone) avr->data[kSpmcsr] &= kRwwsb;
    return 0;
  }
  static avr_cycle_count_t OnHalfDone(avr_t*, avr_cycle_count_t, void* parameter) {
    FlashMemory& flash = From(parameter);
    if (flash.on_operation) flash.on_operation();
    return 0;
  }
  static avr_cycle_count_t OnDone(avr_t*, avr_cycle_count_t, void* parameter) {
    From(parameter).Finish();
    return 0;
  }
};

FlashMemory::FlashMemory(avr_t* avr, double cpu_mhz, std::uint32_t boot_start, std::uint32_t seed,
                         Violation violation)
    : avr_(avr),
      cpu_mhz_(cpu_mhz),
      boot_start_(boot_start),
      noise_(seed * 2246822519u | 1),
      violation_(std::move(violation)) {
  signature_row_.fill(0xff);
  ClearBuffer();
  auto& handlers = avr_->io[AVR_DATA_TO_IO(kSpmcsr)];
  handlers.w.c = &Hooks::WriteControl;
  handlers.w.param = this;
  for (avr_io_t* io = avr_->io_port; io != nullptr; io = io->next) {
    if (std::strcmp(io->kind, "flash") == 0) io->ioctl = &Hooks::Ioctl;
  }
}

void FlashMemory::WriteControl(std::uint8_t value) {
  if (operation_ != Operation::kNone) return;  // as silicon: not while SPMEN is up
  if ((value & kSpmen) && (avr_->data[kEepromControl] & kEepromBusy)) {
    violation_("SPMCSR written while the EEPROM is: it is ignored");
    return;
  }
  avr_->data[kSpmcsr] =
      static_cast<std::uint8_t>((avr_->data[kSpmcsr] & kRwwsb) | (value & ~kRwwsb));
  if (!(value & kSpmen)) return;
  window_end_ = avr_->cycle + kWindowCycles;
  avr_cycle_timer_register(avr_, kWindowCycles, &Hooks::OnWindowEnd, this);
  if ((value & kSigrd) && !signature_shown_) {
    std::copy_n(avr_->flash, covered_.size(), covered_.begin());
    std::copy(signature_row_.begin(), signature_row_.end(), avr_->flash);
    signature_shown_ = true;
  }
}

void FlashMemory::EndSignature() {
  std::copy(covered_.begin(), covered_.end(), avr_->flash);
  signature_shown_ = false;
}

void FlashMemory::Spm() {
  constexpr int kR0 = 0, kR1 = 1, kZl = 30, kZh = 31;
  if (boot_start_ == 0 || avr_->pc < boot_start_) {
    violation_("SPM outside of the boot section: it is ignored");
    return;
  }
  if (operation_ != Operation::kNone || avr_->cycle > window_end_) {
    violation_("SPM without SPMEN in the four cycles before, or during another operation");
    return;
  }
  const auto address =
      static_cast<std::uint32_t>(avr_->data[kZl] | (avr_->data[kZh] << 8)) % kBytes;
  const std::uint8_t command = avr_->data[kSpmcsr] & kCommand;
  const auto word = static_cast<std::size_t>((address % kPageBytes) / 2);
  switch (command) {
    case kSpmen:
      if (filled_[word]) violation_("a word of the page buffer is filled twice");
      buffer_[word] = static_cast<std::uint16_t>(avr_->data[kR0] | (avr_->data[kR1] << 8));
      filled_[word] = true;
      break;
    case kSpmen | kPgers:
      return Begin(Operation::kErase, address);
    case kSpmen | kPgwrt:
      return Begin(Operation::kWrite, address);
    case kSpmen | kRwwsre:
      ShowReadWhileWrite();
      ClearBuffer();
      break;
    default:
      violation_("SPM with an SPMCSR that is not modeled here");
      break;
  }
  avr_->data[kSpmcsr] &= kRwwsb;
}

void FlashMemory::Begin(Operation operation, std::uint32_t address) {
  if (address >= kReadWhileWriteEnd) {
    violation_("a page of the section without read-while-write is erased or written");
    avr_->data[kSpmcsr] &= kRwwsb;
    return;
  }
  page_ = address - address % kPageBytes;
  operation_ = operation;
  HideReadWhileWrite();
  const auto cycles = static_cast<avr_cycle_count_t>(operation_us_ * cpu_mhz_);
  avr_cycle_timer_register(avr_, cycles / 2, &Hooks::OnHalfDone, this);
  avr_cycle_timer_register(avr_, cycles, &Hooks::OnDone, this);
}

std::uint8_t* FlashMemory::Page() { return hidden_.data() + page_; }

// New value of a byte of the page. Programming can only clear bits.
std::uint8_t FlashMemory::Target(std::uint8_t old, int at) const {
  if (operation_ == Operation::kErase) return 0xff;
  const std::uint16_t word = buffer_[static_cast<std::size_t>(at / 2)];
  return old & static_cast<std::uint8_t>(word >> (at % 2 * 8));
}

void FlashMemory::Finish() {
  std::uint8_t* page = Page();
  for (int i = 0; i < kPageBytes; ++i) page[i] = Target(page[i], i);
  if (operation_ == Operation::kWrite) ClearBuffer();
  operation_ = Operation::kNone;
  avr_->data[kSpmcsr] &= kRwwsb;
}

// Any bit may have changed already or not.
void FlashMemory::Tear() {
  if (operation_ == Operation::kNone) return;
  std::uint8_t* page = Page();
  for (int i = 0; i < kPageBytes; ++i) {
    noise_ = noise_ * 1664525u + 1013904223u;
    const auto done = static_cast<std::uint8_t>(noise_ >> 24);
    page[i] = static_cast<std::uint8_t>((page[i] & ~done) | (Target(page[i], i) & done));
  }
  operation_ = Operation::kNone;
}

void FlashMemory::Reset() {
  avr_cycle_timer_cancel(avr_, &Hooks::OnHalfDone, this);
  avr_cycle_timer_cancel(avr_, &Hooks::OnDone, this);
  avr_cycle_timer_cancel(avr_, &Hooks::OnWindowEnd, this);
  if (signature_shown_) EndSignature();
  Tear();
  ShowReadWhileWrite();
  ClearBuffer();
  window_end_ = 0;
}

void FlashMemory::HideReadWhileWrite() {
  if (hidden_.empty()) {
    hidden_.assign(avr_->flash, avr_->flash + kReadWhileWriteEnd);
    std::fill_n(avr_->flash, kReadWhileWriteEnd, std::uint8_t{0xff});
  }
  avr_->data[kSpmcsr] |= kRwwsb;
}

void FlashMemory::ShowReadWhileWrite() {
  std::copy(hidden_.begin(), hidden_.end(), avr_->flash);
  hidden_.clear();
  avr_->data[kSpmcsr] &= static_cast<std::uint8_t>(~kRwwsb);
}

void FlashMemory::ClearBuffer() {
  buffer_.fill(0xffff);
  filled_.fill(false);
}

std::vector<std::uint8_t> FlashMemory::Contents() const {
  std::vector<std::uint8_t> contents(avr_->flash, avr_->flash + kBytes);
  std::copy(hidden_.begin(), hidden_.end(), contents.begin());
  if (signature_shown_) std::copy(covered_.begin(), covered_.end(), contents.begin());
  return contents;
}

std::vector<std::uint8_t> FlashMemory::AfterPowerLoss() {
  Tear();
  return Contents();
}

}  // namespace torquer::emulator
