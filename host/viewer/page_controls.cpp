// Messages from the page.
#include <cmath>
#include <cstring>

#include "host/simulator/command_limits.h"
#include "host/viewer/page_messages.h"

namespace torquer::viewer {
namespace {

template <class Value>
Value ReadAt(std::span<const std::uint8_t> bytes, std::size_t offset) {
  Value value;
  std::memcpy(&value, bytes.data() + offset, sizeof value);
  return value;
}

}  // namespace

std::optional<Controls> ReadControls(std::span<const std::uint8_t> bytes) {
  constexpr std::uint8_t kKnownFlags = 7;
  if (bytes.size() != kControlsBytes) return {};
  if (bytes[0] != static_cast<std::uint8_t>(FrameKind::kControls) || bytes[1] != kFrameVersion ||
      (bytes[2] & ~kKnownFlags) != 0) {
    return {};
  }
  Controls controls;
  controls.xray = (bytes[2] & 1) != 0;
  controls.contrast = (bytes[2] & 2) != 0;
  controls.acquisition = (bytes[2] & 4) != 0;
  controls.instrument = bytes[3];
  controls.push_mm_s = ReadAt<float>(bytes, 4);
  controls.turn_rad_s = ReadAt<float>(bytes, 8);
  controls.lao_rad_s = ReadAt<float>(bytes, 12);
  controls.cra_rad_s = ReadAt<float>(bytes, 16);
  // NaN fails each of these comparisons.
  const bool usable = std::abs(controls.push_mm_s) <= Controls::kMostPushMmS &&
                      std::abs(controls.turn_rad_s) <= Controls::kMostTurnRadS &&
                      std::abs(controls.lao_rad_s) <= Controls::kMostArmRadS &&
                      std::abs(controls.cra_rad_s) <= Controls::kMostArmRadS;
  if (!usable) return {};
  return controls;
}

std::optional<TableMotion> ReadTableMotion(std::span<const std::uint8_t> bytes) {
  if (bytes.size() != kControlsBytes || bytes[0] != static_cast<std::uint8_t>(FrameKind::kTable) ||
      bytes[1] != kFrameVersion) {
    return {};
  }
  const TableMotion motion{ReadAt<float>(bytes, 4), ReadAt<float>(bytes, 8),
                           ReadAt<float>(bytes, 12)};
  for (const double rate_mm_s : {motion.left_mm_s, motion.head_mm_s, motion.height_mm_s}) {
    if (!(std::abs(rate_mm_s) <= TableMotion::kMostMmS)) return {};
  }
  return motion;
}

std::optional<ImagingChoice> ReadImaging(std::span<const std::uint8_t> bytes) {
  if (bytes.size() != kImagingBytes || bytes[0] != static_cast<std::uint8_t>(FrameKind::kImaging) ||
      bytes[1] != kFrameVersion) {
    return {};
  }
  ImagingChoice choice;
  choice.number = ReadAt<std::uint32_t>(bytes, 16);
  effects::Imaging& imaging = choice.imaging;
  imaging.mode = static_cast<effects::Imaging::Mode>(bytes[2]);
  imaging.pulses_per_s = ReadAt<float>(bytes, 4);
  imaging.magnification = ReadAt<float>(bytes, 8);
  imaging.left = 0.01 * bytes[12];
  imaging.right = 0.01 * bytes[13];
  imaging.top = 0.01 * bytes[14];
  imaging.bottom = 0.01 * bytes[15];
  for (std::size_t k = 0; k < imaging.wedges.size(); ++k) {
    imaging.wedges[k] = {0.01 * bytes[20 + k],
                         static_cast<double>(static_cast<std::int8_t>(bytes[22 + k]))};
  }
  if (!simulator::IsValid(imaging)) return {};
  using effects::Imaging;
  choice.acquisition = {static_cast<Imaging::Mode>(bytes[3]), ReadAt<float>(bytes, 24)};
  const auto& [mode, pulses_per_s] = choice.acquisition;
  if (mode != Imaging::Mode::kCine && mode != Imaging::Mode::kSubtraction) return {};
  // NaN fails.
  if (!(pulses_per_s >= Imaging::kLeastPulses && pulses_per_s <= Imaging::kMostPulses)) return {};
  return choice;
}

std::optional<effects::Injector> ReadInjector(std::span<const std::uint8_t> bytes) {
  if (bytes.size() != kInjectorBytes ||
      bytes[0] != static_cast<std::uint8_t>(FrameKind::kInjector) || bytes[1] != kFrameVersion) {
    return {};
  }
  const effects::Injector injector{static_cast<effects::Injector::Order>(bytes[2]),
                                   ReadAt<double>(bytes, 8), ReadAt<double>(bytes, 16),
                                   ReadAt<double>(bytes, 24), ReadAt<double>(bytes, 32)};
  if (!simulator::InvalidValue(injector).empty()) return {};
  return injector;
}

std::optional<ExchangeChoice> ReadExchange(std::span<const std::uint8_t> bytes) {
  constexpr std::size_t kHeadBytes = 4;
  if (bytes.size() != kExchangeBytes ||
      bytes[0] != static_cast<std::uint8_t>(FrameKind::kExchange) || bytes[1] != kFrameVersion) {
    return {};
  }
  const std::size_t length = bytes[3];
  if (length == 0 || length > kExchangeBytes - kHeadBytes) return {};
  const auto name = bytes.subspan(kHeadBytes, length);
  return ExchangeChoice{.instrument = bytes[2], .device = std::string(name.begin(), name.end())};
}

std::optional<ReplayControls> ReadReplayControls(std::span<const std::uint8_t> bytes) {
  if (bytes.size() != kControlsBytes ||
      bytes[0] != static_cast<std::uint8_t>(FrameKind::kReplayControls) ||
      bytes[1] != kFrameVersion || bytes[2] > 1) {
    return {};
  }
  ReplayControls controls;
  controls.play = bytes[2] == 1;
  controls.speed = ReadAt<float>(bytes, 4);
  const double at_s = ReadAt<double>(bytes, 8);
  controls.steps = ReadAt<std::int32_t>(bytes, 16);
  // 0.1 as a float is slightly larger; NaN fails.
  const bool usable = controls.speed >= ReplayControls::kLeastSpeed &&
                      controls.speed <= ReplayControls::kMostSpeed &&
                      controls.steps >= -ReplayControls::kMostSteps &&
                      controls.steps <= ReplayControls::kMostSteps;
  if (!usable || at_s < 0 || std::isinf(at_s)) return {};
  if (!std::isnan(at_s)) controls.at_s = at_s;
  return controls;
}

std::optional<CaseControl> ReadCaseControl(std::span<const std::uint8_t> bytes) {
  if (bytes.size() != kControlsBytes || bytes[0] != static_cast<std::uint8_t>(FrameKind::kCase) ||
      bytes[1] != kFrameVersion || bytes[2] < 1 || bytes[2] > 4) {
    return {};
  }
  return CaseControl{.action = static_cast<CaseControl::Action>(bytes[2]), .number = bytes[3]};
}

}  // namespace torquer::viewer
