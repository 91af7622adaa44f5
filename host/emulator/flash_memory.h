// Flash of an ATmega32U4, which its program can write: page erase and page write by the SPM
// instruction. It models their duration, and the contents after a loss of power. In simavr both
// take no time, and no rule is checked.
#pragma once

#include <array>
#include <cstdint>
#include <functional>
#include <string>
#include <vector>

struct avr_t;

namespace torquer::emulator {

class FlashMemory {
 public:
  static constexpr int kBytes = 32768;
  static constexpr int kPageBytes = 128;
  static constexpr int kSignatureRowBytes = 32;
  /// Pages below this address cannot be read while any of them is erased or written.
  static constexpr std::uint32_t kReadWhileWriteEnd = 0x7000;
  /// Duration of an erase or a write, us; the range on silicon is 3.7 to 4.5 ms.
  static constexpr double kOperationUs = 4000;

  using Violation = std::function<void(const std::string&)>;

  /// Takes over SPMCSR and SPM of `avr`. `boot_start`: start of the boot section, 0 without one.
  /// `violation` gets each access that fails on silicon.
  FlashMemory(avr_t* avr, double cpu_mhz, std::uint32_t boot_start, std::uint32_t seed,
              Violation violation);
  FlashMemory(const FlashMemory&) = delete;
  FlashMemory& operator=(const FlashMemory&) = delete;

  /// Sets another duration of erase and write, for tests in which it does not matter.
  void SetOperationTime(double us) { operation_us_ = us; }
  void SetSignatureRow(const std::array<std::uint8_t, kSignatureRowBytes>& row) {
    signature_row_ = row;
  }

  /// Called during each page erase and page write.
  std::function<void()> on_operation;

  /// Call when the chip is reset: a running operation remains incomplete.
  void Reset();

  /// Contents of the flash. A page that is being erased or written appears as it was before.
  std::vector<std::uint8_t> Contents() const;
  /// Contents of the flash after a loss of power at this moment. In a page that is being erased or
  /// written, each bit has either its old or its new value.
  std::vector<std::uint8_t> AfterPowerLoss();

 private:
  enum class Operation { kNone, kErase, kWrite };
  struct Hooks;

  void WriteControl(std::uint8_t value);
  void Spm();
  void Begin(Operation operation, std::uint32_t address);
  void Finish();
  void Tear();
  void HideReadWhileWrite();
  void ShowReadWhileWrite();
  void EndSignature();
  void ClearBuffer();
  std::uint8_t* Page();
  std::uint8_t Target(std::uint8_t old, int at) const;

  avr_t* avr_;
  double cpu_mhz_;
  double operation_us_ = kOperationUs;
  std::uint32_t boot_start_;
  std::uint32_t noise_;
  Violation violation_;
  std::array<std::uint8_t, kSignatureRowBytes> signature_row_{};
  std::array<std::uint8_t, kSignatureRowBytes> covered_{};  // by the signature row
  bool signature_shown_ = false;
  std::vector<std::uint8_t> hidden_;  // the pages that cannot be read; empty if all can
  std::array<std::uint16_t, kPageBytes / 2> buffer_{};
  std::array<bool, kPageBytes / 2> filled_{};
  Operation operation_ = Operation::kNone;
  std::uint32_t page_ = 0;
  std::uint64_t window_end_ = 0;  // the last cycle at which SPM takes effect
};

}  // namespace torquer::emulator
