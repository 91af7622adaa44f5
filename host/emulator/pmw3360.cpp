#include "host/emulator/pmw3360.h"

#include <algorithm>
#include <cmath>
#include <cstdio>

namespace torquer::emulator {
namespace {

constexpr std::uint8_t kProductId = 0x00, kRevisionId = 0x01, kMotion = 0x02, kDeltaYHigh = 0x06,
                       kSurfaceQuality = 0x07, kSromId = 0x2a, kPowerUpReset = 0x3a,
                       kShutdown = 0x3b, kInverseProductId = 0x3f, kMotionBurst = 0x50,
                       kSromLoadBurst = 0x62;
constexpr std::uint8_t kResetKey = 0x5a, kShutdownKey = 0xb6;
constexpr std::uint8_t kForeignId = 0x47;

// Minimum times in us, by the names of the data sheet.
constexpr double kSelectToClock = 0.120, kAddressToData = 160, kAddressToBurst = 35,
                 kClockToDeselectRead = 0.120, kClockToDeselectWrite = 35, kAfterWrite = 180,
                 kAfterRead = 20, kBurstExit = 0.5, kSromByte = 15, kStartUp = 50000;
constexpr double kMaxClockHz = 2e6;
constexpr double kMmPerInch = 25.4;
constexpr int kSromBytes = 4094;
constexpr std::uint8_t kLoadedSromId = 0x04;

}  // namespace

VirtualPmw3360::VirtualPmw3360(const SensorImperfections& imperfections, std::uint32_t seed)
    : imperfections_(imperfections), random_(seed), surface_([](double) { return Position{}; }) {
  PowerUp(0);
}

void VirtualPmw3360::PowerUp(double now_us) {
  registers_.fill(0);
  registers_[kProductId] = 0x42;
  registers_[kRevisionId] = 0x01;
  registers_[kInverseProductId] = 0xbd;
  registers_[kConfig1] = 0x31;
  usable_from_us_ = now_us + kStartUp;
  burst_armed_ = asleep_ = false;
  based_ = false;
  pending_x_ = pending_y_ = 0;
  srom_bytes_ = 0;
  deselect_us_ = last_byte_end_us_ = write_end_us_ = read_end_us_ = now_us - 1e9;
  last_access_ = Access::kNone;
}

void VirtualPmw3360::Violation(const std::string& what) {
  constexpr std::size_t kKept = 20;
  ++violation_count_;
  if (violations_.size() < kKept) violations_.push_back("PMW3360: " + what);
}

void VirtualPmw3360::Require(double actual_us, double minimum_us, const char* timing) {
  // The emulated CPU acts on whole cycles, so a rounding error is all that may be forgiven.
  if (actual_us >= minimum_us - 1e-6) return;
  char text[200];
  std::snprintf(text, sizeof(text),
                "%s was %.3f us where the data sheet asks for %.3f (register 0x%02x)", timing,
                actual_us, minimum_us, address_);
  Violation(text);
}

void VirtualPmw3360::SetSelected(bool selected, double now_us) {
  if (selected == selected_) return;
  selected_ = selected;
  if (selected) {
    if (last_access_ == Access::kBurst) {
      Require(now_us - deselect_us_, kBurstExit, "tBEXIT (NCS high after a burst)");
    }
    select_us_ = now_us;
    byte_index_ = 0;
    access_ = Access::kNone;
    return;
  }
  deselect_us_ = now_us;
  if (access_ == Access::kWrite) {
    Require(now_us - last_byte_end_us_, kClockToDeselectWrite, "tSCLK-NCS (write)");
  } else if (access_ != Access::kNone) {
    Require(now_us - last_byte_end_us_, kClockToDeselectRead, "tSCLK-NCS (read)");
  }
  if (access_ == Access::kSromLoad) {
    registers_[kSromId] = srom_bytes_ == kSromBytes ? kLoadedSromId : 0;
    write_end_us_ = last_byte_end_us_;
  }
  last_access_ = access_;
}

void VirtualPmw3360::Begin(const SpiExchange& exchange) {
  address_ = exchange.sent & 0x7f;
  const bool write = exchange.sent & 0x80;
  Require(exchange.start_us - select_us_, kSelectToClock, "tNCS-SCLK");
  Require(exchange.start_us - write_end_us_, kAfterWrite, write ? "tSWW" : "tSWR");
  Require(exchange.start_us - read_end_us_, kAfterRead, write ? "tSRW" : "tSRR");
  if (exchange.start_us < usable_from_us_) {
    Violation("accessed within 50 ms of its power-up or reset");
  }
  if (asleep_ && !(write && address_ == kPowerUpReset)) {
    Violation("accessed while it is shut down");
  }
  if (write) {
    access_ = address_ == kSromLoadBurst ? Access::kSromLoad : Access::kWrite;
    if (access_ == Access::kSromLoad) srom_bytes_ = 0;
  } else if (address_ == kMotionBurst) {
    access_ = Access::kBurst;
    if (!burst_armed_) Violation("motion burst without the write to 0x50 that arms it");
    LatchBurst(exchange.end_us);
  } else {
    access_ = Access::kRead;
  }
}

std::uint8_t VirtualPmw3360::Exchange(const SpiExchange& exchange) {
  if (!selected_) return 0xff;
  if (exchange.clock_hz > kMaxClockHz * 1.001) Violation("SPI clock above 2 MHz");
  if (exchange.mode != 3) Violation("SPI mode other than 3");

  std::uint8_t answer = 0;
  if (byte_index_ == 0) {
    Begin(exchange);
  } else {
    const double gap_us = exchange.start_us - last_byte_end_us_;
    switch (access_) {
      case Access::kRead:
        if (byte_index_ == 1) Require(gap_us, kAddressToData, "tSRAD");
        answer = registers_[address_];
        if (fault_ == Fault::kForeign && address_ == kProductId) answer = kForeignId;
        read_end_us_ = exchange.end_us;
        if (address_ >= kMotion && address_ <= kDeltaYHigh) registers_[address_] = 0;
        burst_armed_ = false;
        break;
      case Access::kBurst:
        if (byte_index_ == 1) Require(gap_us, kAddressToBurst, "tSRAD_MOTBR");
        if (byte_index_ <= static_cast<int>(burst_.size())) {
          answer = burst_[static_cast<std::size_t>(byte_index_ - 1)];
        }
        break;
      case Access::kWrite:
        WriteRegister(address_, exchange.sent, exchange.end_us);
        break;
      case Access::kSromLoad:
        Require(gap_us, kSromByte, "time between SROM bytes");
        ++srom_bytes_;
        break;
      case Access::kNone:
        break;
    }
  }
  ++byte_index_;
  last_byte_end_us_ = exchange.end_us;
  if (fault_ == Fault::kSilent) return 0xff;
  if (fault_ == Fault::kShorted) return 0x00;
  return answer;
}

void VirtualPmw3360::WriteRegister(std::uint8_t address, std::uint8_t value, double now_us) {
  burst_armed_ = address == kMotionBurst;
  registers_[address] = value;
  if (address == kPowerUpReset && value == kResetKey) PowerUp(now_us);
  if (address == kShutdown && value == kShutdownKey) asleep_ = true;
  write_end_us_ = now_us;
}

void VirtualPmw3360::LatchBurst(double now_us) {
  const Position position = surface_(now_us);
  const bool blind = lifted_ || fault_ == Fault::kSilent || fault_ == Fault::kShorted;
  if (blind || !based_) {
    last_ = position;
    based_ = true;
  }
  const double axial = (position.axial_mm - last_.axial_mm) / kMmPerInch * cpi();
  const double transverse = (position.transverse_mm - last_.transverse_mm) / kMmPerInch * cpi();
  last_ = position;
  const double cosine = std::cos(imperfections_.misalignment_rad);
  const double sine = std::sin(imperfections_.misalignment_rad);
  pending_x_ += imperfections_.scale * (cosine * axial + sine * transverse);
  pending_y_ += imperfections_.scale * (-sine * axial + cosine * transverse);
  if (imperfections_.noise_counts > 0 && (axial != 0 || transverse != 0)) {
    std::normal_distribution<double> noise(0, imperfections_.noise_counts);
    pending_x_ += noise(random_);
    pending_y_ += noise(random_);
  }
  const auto take = [](double& pending) {
    // Nearest, not down: a hand that stands still on a count's edge must not flicker by rounding.
    const double whole = std::clamp(std::nearbyint(pending), -32768.0, 32767.0);
    pending -= whole;
    return static_cast<int>(whole);
  };
  const int x = take(pending_x_);
  const int y = take(pending_y_);
  axial_counts_ += x;
  transverse_counts_ += y;

  constexpr std::uint8_t kMoved = 0x80, kLiftedBit = 0x08;
  const int shutter = lifted_ ? 0x0a00 : 0x0060;
  registers_[kSurfaceQuality] = lifted_ ? 2 : 64;
  burst_ = {static_cast<std::uint8_t>((x || y ? kMoved : 0) | (lifted_ ? kLiftedBit : 0)),
            0x3f,
            static_cast<std::uint8_t>(x),
            static_cast<std::uint8_t>(x >> 8),
            static_cast<std::uint8_t>(y),
            static_cast<std::uint8_t>(y >> 8),
            registers_[kSurfaceQuality],
            0x30,
            0x60,
            0x20,
            static_cast<std::uint8_t>(shutter >> 8),
            static_cast<std::uint8_t>(shutter)};
}

}  // namespace torquer::emulator
