// Self-programming of the chip's flash: small programs in the boot section, given as machine words.
#include <catch2/catch.hpp>
#include <cstring>
#include <initializer_list>
#include <vector>

#include "host/emulator/atmega32u4.h"
#include "tests/support/paths.h"

namespace torquer::emulator {
namespace {

constexpr std::uint32_t kBoot = 0x7800, kProgram = 0x7900;
constexpr std::uint16_t kSpm = 0x95e8, kStay = 0xcfff;
constexpr int kErase = 0x03, kWrite = 0x05, kFill = 0x01, kEnable = 0x11, kLock = 0x09;
constexpr std::uint32_t kPage = 0x0480, kOther = 0x0502;

using Words = std::vector<std::uint16_t>;

std::uint16_t Ldi(int reg, int value) {
  return static_cast<std::uint16_t>(0xe000 | (value & 0xf0) << 4 | (reg - 16) << 4 | (value & 0xf));
}
void Append(Words* words, std::initializer_list<std::uint16_t> more) {
  words->insert(words->end(), more);
}

// Writes SPMCSR, followed by SPM if requested.
void Command(Words* words, std::uint32_t address, int command, bool spm = true) {
  Append(words, {Ldi(30, static_cast<int>(address & 0xff)), Ldi(31, static_cast<int>(address >> 8)),
                 Ldi(24, command), 0xbf87 /* out SPMCSR, r24 */});
  if (spm) words->push_back(kSpm);
}
void Fill(Words* words, std::uint32_t address, int value) {
  Append(words, {Ldi(16, value & 0xff), Ldi(17, value >> 8), 0x0108 /* movw r0, r16 */});
  Command(words, address, kFill);
}
void WaitUntilDone(Words* words) {
  Append(words, {0xb787 /* in r24, SPMCSR */, 0xfd80 /* sbrc r24, 0 */, 0xcffd /* rjmp back */});
}

struct Chip {
  explicit Chip(Words program, std::uint32_t at = kProgram)
      : image(torquer::test::FirmwarePath("torquer-bootloader.elf")) {
    program.push_back(kStay);
    std::vector<std::uint8_t> flash(FlashMemory::kBytes, 0xff);
    for (int i = 0; i < 2 * FlashMemory::kPageBytes; ++i) {
      flash[kPage + static_cast<std::size_t>(i)] = static_cast<std::uint8_t>(i * 7);
    }
    const std::uint16_t jump[] = {0x940c, static_cast<std::uint16_t>(at / 2)};
    std::memcpy(&flash[kBoot], jump, sizeof(jump));
    std::memcpy(&flash[at], program.data(), 2 * program.size());
    before = flash;
    image.SetFlash(flash);
    chip = std::make_unique<Atmega32u4>(image, std::vector<std::uint8_t>(), 1);
  }
  std::vector<std::uint8_t> RunFor(double us) {
    chip->RunUntil(chip->now_us() + us);
    return chip->flash().Contents();
  }
  std::string Violation() const {
    const std::vector<std::string> all = chip->Violations();
    return all.empty() ? "" : all.front();
  }

  FirmwareImage image;
  std::vector<std::uint8_t> before;
  std::unique_ptr<Atmega32u4> chip;
};

TEST_CASE("a page is erased in 4 ms, and can be read when it is enabled again") {
  Words program;
  Command(&program, kPage, kErase);
  WaitUntilDone(&program);
  Chip chip(program);
  CHECK(chip.RunFor(3900) == chip.before);
  const std::vector<std::uint8_t> after = chip.RunFor(200);
  for (std::size_t i = 0; i < after.size(); ++i) {
    const bool in_page = i >= kPage && i < kPage + FlashMemory::kPageBytes;
    REQUIRE(after[i] == (in_page ? 0xff : chip.before[i]));
  }
  CHECK(chip.chip->Violations().empty());
}

TEST_CASE("from an erase on the lower flash reads as blank, until it is enabled") {
  // The program stores the read value in the erased page, where the test can see it.
  const bool enable_first = GENERATE(false, true);
  Words program;
  Command(&program, kPage, kErase);
  WaitUntilDone(&program);
  if (enable_first) Command(&program, 0, kEnable);
  Append(&program, {Ldi(30, kOther & 0xff), Ldi(31, kOther >> 8), 0x9104 /* lpm r16, Z */,
                    Ldi(17, 0), 0x0108 /* movw r0, r16 */});
  if (!enable_first) Command(&program, 0, kEnable);
  Command(&program, kPage, kFill);
  Command(&program, kPage, kWrite);
  WaitUntilDone(&program);
  Chip chip(program);
  const std::vector<std::uint8_t> after = chip.RunFor(10000);
  CHECK(after[kPage] == (enable_first ? chip.before[kOther] : 0xff));
  CHECK(after[kPage + 1] == 0);
  CHECK(chip.chip->Violations().empty());
}

TEST_CASE("programming clears bits and sets none") {
  Words program;
  Fill(&program, kPage + 10, 0x0ff0);
  Command(&program, kPage, kWrite);
  WaitUntilDone(&program);
  Chip chip(program);
  const std::vector<std::uint8_t> after = chip.RunFor(5000);
  CHECK(after[kPage + 10] == (chip.before[kPage + 10] & 0xf0));
  CHECK(after[kPage + 11] == (chip.before[kPage + 11] & 0x0f));
  CHECK(after[kPage + 12] == chip.before[kPage + 12]);
  CHECK(chip.chip->Violations().empty());
}

TEST_CASE("after a loss of power each bit has its old or its new value") {
  SECTION("erasing") {
    Words program;
    Command(&program, kPage, kErase);
    Chip chip(program);
    chip.RunFor(2000);
    const std::vector<std::uint8_t> left = chip.chip->flash().AfterPowerLoss();
    int changed = 0;
    for (std::size_t i = kPage; i < kPage + FlashMemory::kPageBytes; ++i) {
      REQUIRE((left[i] & chip.before[i]) == chip.before[i]);
      changed += left[i] != chip.before[i] && left[i] != 0xff;
    }
    CHECK(changed > 50);
  }
  SECTION("writing") {
    Words program;
    for (std::uint32_t at = kPage; at < kPage + FlashMemory::kPageBytes; at += 2) {
      Fill(&program, at, 0);
    }
    Command(&program, kPage, kWrite);
    Chip chip(program);
    chip.RunFor(2000);
    const std::vector<std::uint8_t> left = chip.chip->flash().AfterPowerLoss();
    int changed = 0;
    for (std::size_t i = kPage; i < kPage + FlashMemory::kPageBytes; ++i) {
      REQUIRE((left[i] | chip.before[i]) == chip.before[i]);
      changed += left[i] != chip.before[i] && left[i] != 0;
    }
    CHECK(changed > 50);
  }
}

TEST_CASE("writes that the chip ignores are ignored and named") {
  const auto only_named = [](Chip& chip, const char* rule) {
    CHECK(chip.RunFor(10000) == chip.before);
    CHECK_THAT(chip.Violation(), Catch::Contains(rule));
  };
  Words program;
  SECTION("SPM from the application") {
    Command(&program, kPage, kErase);
    Chip chip(program, 0x0100);
    only_named(chip, "outside of the boot section");
  }
  SECTION("SPM that comes too late") {
    Command(&program, kPage, kErase, /*spm=*/false);
    Append(&program, {0, 0, 0, 0, 0, 0, kSpm});
    Chip chip(program);
    only_named(chip, "without SPMEN");
  }
  SECTION("SPM during an erase") {
    Command(&program, kPage, kErase);
    Append(&program, {kSpm});
    Chip chip(program);
    chip.RunFor(10000);
    CHECK_THAT(chip.Violation(), Catch::Contains("during another operation"));
  }
  SECTION("a page beyond those that can be read while they are written") {
    Command(&program, 0x7080, kErase);
    Chip chip(program);
    only_named(chip, "without read-while-write");
  }
  SECTION("lock bits") {
    Command(&program, 0, kLock);
    Chip chip(program);
    only_named(chip, "not modeled");
  }
  SECTION("a word of the buffer filled twice") {
    Fill(&program, kPage, 0x1234);
    Fill(&program, kPage, 0x5678);
    Chip chip(program);
    only_named(chip, "filled twice");
  }
}

}  // namespace
}  // namespace torquer::emulator
