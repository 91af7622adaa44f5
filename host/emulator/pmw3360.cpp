#include "host/emulator/pmw3360.h"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <utility>

#include "host/emulator/pmw3360_data.h"

namespace torquer::emulator {
namespace {

using pmw3360_data::kProductId, pmw3360_data::kMotion, pmw3360_data::kDeltaXLow,
    pmw3360_data::kDeltaYHigh, pmw3360_data::kSurfaceQuality, pmw3360_data::kRawDataSum,
    pmw3360_data::kMaximumRawData, pmw3360_data::kMinimumRawData, pmw3360_data::kShutterLower,
    pmw3360_data::kShutterUpper, pmw3360_data::kConfig2, pmw3360_data::kFrameCapture,
    pmw3360_data::kSromEnable, pmw3360_data::kRunDownshift, pmw3360_data::kRest1Rate,
    pmw3360_data::kRest1Downshift, pmw3360_data::kRest2Rate, pmw3360_data::kRest2Downshift,
    pmw3360_data::kRest3Rate, pmw3360_data::kObservation, pmw3360_data::kSromId,
    pmw3360_data::kPowerUpReset, pmw3360_data::kShutdown, pmw3360_data::kMotionBurst,
    pmw3360_data::kSromLoadBurst, pmw3360_data::kRawDataBurst, pmw3360_data::kResetValues,
    pmw3360_data::kReadOnly, pmw3360_data::kResetKey, pmw3360_data::kShutdownKey,
    pmw3360_data::kRestEnable, pmw3360_data::kReservedConfig2, pmw3360_data::kSromPrepare,
    pmw3360_data::kSromStart, pmw3360_data::kCaptureFirst, pmw3360_data::kCaptureSecond,
    pmw3360_data::kForeignId, pmw3360_data::kResolutionLow, pmw3360_data::kResolutionHigh,
    pmw3360_data::kPmw3389Values, pmw3360_data::kSromRun, pmw3360_data::kFrameBits,
    pmw3360_data::kSelectToClock, pmw3360_data::kAddressToData, pmw3360_data::kAddressToBurst,
    pmw3360_data::kClockToDeselectRead, pmw3360_data::kClockToDeselectWrite,
    pmw3360_data::kAfterWrite, pmw3360_data::kAfterRead, pmw3360_data::kBurstExit,
    pmw3360_data::kRawDataExit, pmw3360_data::kLongBurstByte, pmw3360_data::kStartUp,
    pmw3360_data::kSromPrepareWait, pmw3360_data::kCaptureWait, pmw3360_data::kCaptureAfterReset,
    pmw3360_data::kMaxClockHz, pmw3360_data::kSromBytes, pmw3360_data::kMillisecond_us;

}  // namespace

VirtualPmw3360::VirtualPmw3360(const SensorImperfections& imperfections, std::uint32_t seed)
    : imperfections_(imperfections),
      seed_(seed),
      random_(seed * 2246822519u + 1),
      navigation_(imperfections, seed),
      surface_([](double) { return Position{}; }) {
  PowerUp(0);
}

int VirtualPmw3360::cpi() const {
  if (kind_ == SensorKind::kPmw3360) return (registers_[kConfig1] + 1) * 100;
  return (registers_[kResolutionLow] + 256 * registers_[kResolutionHigh] + 1) * 50;
}

void VirtualPmw3360::SetSurface(std::function<Position(double)> surface) {
  surface_ = surface;
  navigation_.SetSurface(std::move(surface));
}

void VirtualPmw3360::Reset(double now_us) {
  registers_.fill(0);
  for (const auto& [address, value] : kResetValues) registers_[address] = value;
  if (kind_ == SensorKind::kPmw3389) {
    for (const auto& [address, value] : kPmw3389Values) registers_[address] = value;
  }
  reset_us_ = now_us;
  ClearObservation(now_us);
  burst_armed_ = asleep_ = set_up_ = configured_ = unnoticed_reset_ = false;
  srom_.clear();
  srom_load_ = SromLoad::kNone;
  capture_ = Capture::kNone;
}

void VirtualPmw3360::PowerUp(double now_us) {
  Reset(now_us);
  usable_from_us_ = now_us + kStartUp;
  navigation_.Restart(usable_from_us_);
  deselect_us_ = last_byte_end_us_ = write_end_us_ = read_end_us_ = now_us - 1e9;
  last_access_ = Access::kNone;
  next_self_reset_us_ = std::numeric_limits<double>::infinity();
  if (imperfections_.self_reset_interval_s > 0) {
    std::exponential_distribution<double> wait(1e-6 / imperfections_.self_reset_interval_s);
    next_self_reset_us_ = usable_from_us_ + wait(random_);
  }
}

void VirtualPmw3360::ResetItself(double now_us, double boot_us) {
  std::uniform_real_distribution<double> boot(2 * kMillisecond_us, kStartUp);
  if (boot_us < 0) boot_us = boot(random_);
  Reset(now_us);
  unnoticed_reset_ = true;
  ++self_resets_;
  navigation_.Restart(now_us + boot_us);
}

void VirtualPmw3360::FollowSelfResets(double now_us) {
  if (now_us < next_self_reset_us_ || asleep_) return;
  ResetItself(next_self_reset_us_);
  std::exponential_distribution<double> wait(1e-6 / imperfections_.self_reset_interval_s);
  next_self_reset_us_ = now_us + kStartUp + wait(random_);
}

void VirtualPmw3360::Violation(const std::string& what) {
  constexpr std::size_t kKept = 20;
  ++violation_count_;
  if (violations_.size() < kKept) violations_.push_back("PMW3360: " + what);
}

void VirtualPmw3360::Require(double actual_us, double minimum_us, const char* timing) {
  // The emulated CPU acts on whole cycles, so only a rounding error is tolerated.
  if (actual_us >= minimum_us - 1e-6) return;
  char text[200];
  std::snprintf(text, sizeof(text),
                "%s was %.3f us where the data sheet asks for %.3f (register 0x%02x)", timing,
                actual_us, minimum_us, address_);
  Violation(text);
}

void VirtualPmw3360::RequireSteady(double gap_us, const char* burst) {
  Require(gap_us, kLongBurstByte, burst);
  longest_burst_gap_us_ = std::max(longest_burst_gap_us_, gap_us);
  if (gap_us <= kLongestBurstGap_us) return;
  char text[160];
  std::snprintf(text, sizeof(text), "%s: a pause of %.0f us inside the burst", burst, gap_us);
  Violation(text);
}

void VirtualPmw3360::SetSelected(bool selected, double now_us) {
  if (selected == selected_) return;
  selected_ = selected;
  if (selected) {
    if (last_access_ == Access::kBurst) {
      Require(now_us - deselect_us_, kBurstExit, "tBEXIT (NCS high after a burst)");
    } else if (last_access_ == Access::kRawData) {
      Require(now_us - deselect_us_, kRawDataExit, "tBEXIT (NCS high after raw data)");
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
  if (access_ == Access::kSromLoad) FinishSrom();
  if (access_ == Access::kRawData) {
    // Address and pixels: fewer, and the picture is cut off.
    if (byte_index_ - 1 != static_cast<int>(picture_.size())) {
      Violation("raw data burst of " + std::to_string(byte_index_ - 1) + " bytes; a picture has " +
                std::to_string(picture_.size()));
    }
    capture_ = Capture::kDone;
  }
  last_access_ = access_;
}

void VirtualPmw3360::FinishSrom() {
  write_end_us_ = last_byte_end_us_;
  const bool whole = incoming_srom_.size() == kSromBytes &&
                     (expected_srom_.empty() || incoming_srom_ == expected_srom_);
  srom_load_ = SromLoad::kLoaded;
  // The second byte of an image is its number.
  registers_[kSromId] = whole ? incoming_srom_[1] : std::uint8_t{0};
  srom_ = whole ? incoming_srom_ : std::vector<std::uint8_t>{};
  ClearObservation(last_byte_end_us_);
  navigation_.Restart(last_byte_end_us_);
}

void VirtualPmw3360::Begin(const SpiExchange& exchange) {
  address_ = exchange.sent & 0x7f;
  const bool write = exchange.sent & 0x80;
  FollowSelfResets(exchange.start_us);
  Require(exchange.start_us - select_us_, kSelectToClock, "tNCS-SCLK");
  Require(exchange.start_us - write_end_us_, kAfterWrite, write ? "tSWW" : "tSWR");
  Require(exchange.start_us - read_end_us_, kAfterRead, write ? "tSRW" : "tSRR");
  if (exchange.start_us < usable_from_us_) {
    Violation("accessed within 50 ms of its power-up or reset");
  }
  if (asleep_ && !(write && address_ == kPowerUpReset)) {
    Violation("accessed while it is shut down");
  }
  const bool restart = write && address_ == kPowerUpReset;
  if (srom_load_ == SromLoad::kLoaded && !restart && !unnoticed_reset_) {
    if (write || address_ != kSromId) {
      Violation("another register than SROM_ID accessed first after a firmware image");
    }
    srom_load_ = SromLoad::kNone;
  }
  if (capture_ == Capture::kDone && !restart && !unnoticed_reset_ && address_ != kShutdown &&
      address_ != kFrameCapture && address_ != kConfig2) {
    Violation("used after a raw picture without a reset: it does not navigate");
  }
  write ? BeginWrite() : BeginRead(exchange);
}

void VirtualPmw3360::BeginWrite() {
  access_ = address_ == kSromLoadBurst ? Access::kSromLoad : Access::kWrite;
  if (access_ != Access::kSromLoad) return;
  if (srom_load_ != SromLoad::kEnabled && !unnoticed_reset_) {
    Violation("firmware image without 0x1d and 0x18 in SROM_Enable before it");
  }
  incoming_srom_.clear();
}

void VirtualPmw3360::BeginRead(const SpiExchange& exchange) {
  if (address_ == kMotionBurst) {
    access_ = Access::kBurst;
    if (!burst_armed_ && !unnoticed_reset_) {
      Violation("motion burst without the write to 0x50 that arms it");
    }
    Latch(exchange.end_us);
  } else if (address_ == kRawDataBurst) {
    access_ = Access::kRawData;
    if (capture_ != Capture::kTaken && !unnoticed_reset_) {
      Violation("raw data burst without a picture taken");
    } else {
      Require(exchange.start_us - capture_us_, kCaptureWait, "time to take a raw picture");
    }
    TakePicture(exchange.start_us);
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
    answer = ReadByte(exchange);
  }
  ++byte_index_;
  last_byte_end_us_ = exchange.end_us;
  if (fault_ == Fault::kSilent) return 0xff;
  if (fault_ == Fault::kShorted) return 0x00;
  return answer;
}

// A byte after the address, in either direction.
std::uint8_t VirtualPmw3360::ReadByte(const SpiExchange& exchange) {
  const double gap_us = exchange.start_us - last_byte_end_us_;
  const auto index = static_cast<std::size_t>(byte_index_ - 1);
  switch (access_) {
    case Access::kRead: {
      if (index == 0) Require(gap_us, kAddressToData, "tSRAD");
      read_end_us_ = exchange.end_us;
      burst_armed_ = false;
      if (address_ == kObservation) return Observation(exchange.start_us);
      if (fault_ == Fault::kForeign && address_ == kProductId) return kForeignId;
      if (address_ == kMotion) Latch(exchange.start_us);
      const std::uint8_t value = registers_[address_];
      if (address_ >= kDeltaXLow && address_ <= kDeltaYHigh) registers_[address_] = 0;
      return value;
    }
    case Access::kBurst:
      if (index == 0) Require(gap_us, kAddressToBurst, "tSRAD_MOTBR");
      return index < burst_.size() ? burst_[index] : std::uint8_t{0};
    case Access::kRawData:
      if (index == 0) {
        Require(gap_us, kAddressToData, "tSRAD");
      } else {
        RequireSteady(gap_us, "time between raw data bytes");
      }
      return index < picture_.size() ? picture_[index] : std::uint8_t{0};
    case Access::kWrite:
      WriteRegister(address_, exchange.sent, exchange.end_us);
      return 0;
    case Access::kSromLoad:
      RequireSteady(gap_us, "time between SROM bytes");
      incoming_srom_.push_back(exchange.sent);
      return 0;
    case Access::kNone:
      break;
  }
  return 0;
}

void VirtualPmw3360::WriteRegister(std::uint8_t address, std::uint8_t value, double now_us) {
  burst_armed_ = address == kMotionBurst;
  write_end_us_ = now_us;
  if (std::find(std::begin(kReadOnly), std::end(kReadOnly), address) != std::end(kReadOnly)) {
    Violation("write to a register that is read only");
    return;
  }
  // Motion up to now counts with the old register values.
  const bool resolution =
      address == kConfig1 || (address == kResolutionLow && kind_ == SensorKind::kPmw3389);
  if (resolution || address == kConfig2) {
    navigation_.Advance(now_us, NavigationSettings(), blind());
  }
  registers_[address] = value;
  configured_ = configured_ || resolution;
  switch (address) {
    case kPowerUpReset:
      if (value == kResetKey) PowerUp(now_us);
      break;
    case kShutdown:
      asleep_ = asleep_ || value == kShutdownKey;
      break;
    case kConfig2:
      registers_[kConfig2] |= kReservedConfig2;
      navigation_.Advance(now_us, NavigationSettings(), blind());
      break;
    case kObservation:
      ClearObservation(now_us);
      break;
    case kMotionBurst:
      if (imperfections_.arming_clears) {
        navigation_.Advance(now_us, NavigationSettings(), blind());
        navigation_.Take();
      }
      break;
    case kFrameCapture:
      WriteFrameCapture(value, now_us);
      break;
    case kSromEnable:
      WriteSromEnable(value, now_us);
      break;
    default:
      break;
  }
}

void VirtualPmw3360::WriteFrameCapture(std::uint8_t value, double now_us) {
  if (rest_enabled()) Violation("raw picture asked for with rest modes enabled");
  if (value == kCaptureFirst) {
    Require(now_us - reset_us_, kCaptureAfterReset, "time from a reset to a raw picture");
    capture_ = Capture::kAsked;
  } else if (value == kCaptureSecond && capture_ == Capture::kAsked) {
    capture_ = Capture::kTaken;
    capture_us_ = now_us;
    srom_.clear();
    registers_[kSromId] = 0;
  }
}

void VirtualPmw3360::WriteSromEnable(std::uint8_t value, double now_us) {
  if (value == kSromPrepare) {
    if (rest_enabled()) Violation("firmware image asked for with rest modes enabled");
    srom_load_ = SromLoad::kPrepared;
    srom_step_us_ = now_us;
  } else if (value == kSromStart && srom_load_ == SromLoad::kPrepared) {
    Require(now_us - srom_step_us_, kSromPrepareWait, "time from 0x1d to 0x18 in SROM_Enable");
    srom_load_ = SromLoad::kEnabled;
  }
}

bool VirtualPmw3360::rest_enabled() const { return registers_[kConfig2] & kRestEnable; }

bool VirtualPmw3360::blind() const {
  return lifted_ || fault_ == Fault::kSilent || fault_ == Fault::kShorted ||
         fault_ == Fault::kFrozen || capture_ != Capture::kNone;
}

// The bits of a frame come up in the frame after they were cleared, and stay.
std::uint8_t VirtualPmw3360::Observation(double now_us) {
  if (fault_ != Fault::kFrozen && capture_ == Capture::kNone) {
    observed_ = observed_ ||
                navigation_.LatestFrameUs(now_us, NavigationSettings()) > observation_cleared_us_;
  }
  return static_cast<std::uint8_t>((srom_.empty() ? 0 : kSromRun) | (observed_ ? kFrameBits : 0));
}

void VirtualPmw3360::ClearObservation(double now_us) {
  observation_cleared_us_ = now_us;
  observed_ = false;
}

std::uint8_t VirtualPmw3360::OperationMode() const {
  return static_cast<std::uint8_t>(static_cast<int>(navigation_.mode()) << 1);
}

SensorNavigation::Settings VirtualPmw3360::NavigationSettings() const {
  const auto wide = [this](std::uint8_t low) {
    return registers_[low] + 256 * registers_[low + 1];
  };
  SensorNavigation::Settings settings;
  settings.cpi = cpi();
  settings.rest_enabled = rest_enabled();
  settings.magnification = [this](double raised_mm) {
    return Magnification(optics_, optics_.distance_mm - raised_mm);
  };
  const double rate1_ms = wide(kRest1Rate) + 1, rate2_ms = wide(kRest2Rate) + 1;
  settings.rest_period_us[0] = kMillisecond_us * rate1_ms;
  settings.rest_period_us[1] = kMillisecond_us * rate2_ms;
  settings.rest_period_us[2] = kMillisecond_us * (wide(kRest3Rate) + 1);
  settings.downshift_us[0] = kMillisecond_us * 10 * registers_[kRunDownshift];
  settings.downshift_us[1] = kMillisecond_us * 320 * registers_[kRest1Downshift] * rate1_ms;
  settings.downshift_us[2] = kMillisecond_us * 32 * registers_[kRest2Downshift] * rate2_ms;
  return settings;
}

void VirtualPmw3360::TakePicture(double now_us) {
  const Position position = surface_(now_us);
  SurfaceOptics optics = optics_;
  optics.distance_mm -= position.raised_mm;
  picture_ = RenderSurface(-position.transverse_mm, position.axial_mm, optics, seed_);
}

// Latches the counts that a read of motion returns, in the registers and in the burst.
void VirtualPmw3360::Latch(double now_us) {
  navigation_.Advance(now_us, NavigationSettings(), blind());
  const SensorNavigation::Counts counts = navigation_.Take();
  if (set_up_) {
    axial_counts_ += counts.y;
    transverse_counts_ -= counts.x;
  } else {
    stray_counts_ += std::abs(counts.x) + std::abs(counts.y);
    // The first burst after the setup discards the earlier motion.
    set_up_ = configured_ && access_ == Access::kBurst;
  }

  constexpr std::uint8_t kMoved = 0x80, kLiftedBit = 0x08;
  const bool running = navigation_.running(now_us);
  const bool resting = navigation_.mode() != SensorNavigation::Mode::kRun;
  const int shutter = lifted_ ? 0x0a00 : 0x0060;
  registers_[kMotion] = static_cast<std::uint8_t>((counts.x || counts.y ? kMoved : 0) |
                                                  (lifted_ ? kLiftedBit : 0) | OperationMode());
  registers_[kDeltaXLow] = static_cast<std::uint8_t>(counts.x);
  registers_[kDeltaXLow + 1] = static_cast<std::uint8_t>(counts.x >> 8);
  registers_[kDeltaXLow + 2] = static_cast<std::uint8_t>(counts.y);
  registers_[kDeltaYHigh] = static_cast<std::uint8_t>(counts.y >> 8);
  // Valid in run mode alone.
  registers_[kSurfaceQuality] = lifted_ ? std::uint8_t{2} : SurfaceQuality(optics_);
  if (resting || !running || fault_ == Fault::kFrozen) registers_[kSurfaceQuality] = 0;
  registers_[kRawDataSum] = 0x30;
  registers_[kMaximumRawData] = 0x60;
  registers_[kMinimumRawData] = 0x20;
  registers_[kShutterUpper] = static_cast<std::uint8_t>(shutter >> 8);
  registers_[kShutterLower] = static_cast<std::uint8_t>(shutter);
  burst_ = {registers_[kMotion],         Observation(now_us),        registers_[kDeltaXLow],
            registers_[kDeltaXLow + 1],  registers_[kDeltaXLow + 2], registers_[kDeltaYHigh],
            registers_[kSurfaceQuality], registers_[kRawDataSum],    registers_[kMaximumRawData],
            registers_[kMinimumRawData], registers_[kShutterUpper],  registers_[kShutterLower]};
}

}  // namespace torquer::emulator
