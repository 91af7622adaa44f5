#include "host/recorder/page_text.h"

#include <fmt/chrono.h>
#include <fmt/format.h>

#include <cmath>
#include <ctime>
#include <utility>

#include "host/plot/table.h"
#include "host/recorder/svg_text.h"
#include "host/support/printable_text.h"

namespace torquer {

std::string SafeText(std::string_view text) { return plot::EscapeMarkup(Printable(text)); }

std::string SecondsText(double seconds) {
  if (seconds < 99.95) {
    const auto tenths = static_cast<std::int64_t>(std::lround(10 * seconds));
    return fmt::format("{}:{:02}.{} min", tenths / 600, tenths / 10 % 60, tenths % 10);
  }
  const auto whole = static_cast<std::int64_t>(std::lround(seconds));
  return fmt::format("{}:{:02} min", whole / 60, whole % 60);
}

std::string ValueText(double value) {
  if (value == 0) return "0";
  // From here on three digits have no decimal place.
  constexpr double kWhole = 99.95;
  return std::abs(value) < kWhole ? fmt::format("{:#.3g}", value) : fmt::format("{:.0f}", value);
}

std::string ReadingText(std::string_view name, double value) {
  // Ends of names and their units; an end that contains a later one comes before it.
  static constexpr std::pair<std::string_view, std::string_view> kUnits[] = {
      {"_mm_s", "mm/s"},
      {"_mL_s", "mL/s"},
      {"line_load_mN_mm", "mN/mm"},
      {"_mN_mm", "mN mm"},
      {"_mN", "mN"},
      {"_mm", "mm"},
      {"_mNs", "mN s"},
      {"_kPa", "kPa"},
      {"_mJ", "mJ"},
      {"_mL", "mL"},
      {"_mg", "mg"},
      {"_mGy", "mGy"},
      {"_mGy_min", "mGy/min"},
      {"_Gy_cm2", "Gy cm\u00b2"}};
  constexpr double kLongestS = 1e9;  // values of a log may be anything
  if (std::isnan(value)) return "not known";
  for (const auto& [end, unit] : kUnits) {
    if (name.ends_with(end)) return ValueText(value) + " " + std::string(unit);
  }
  if (name.ends_with("_s")) {
    return value >= 0 && value < kLongestS ? SecondsText(value) : ValueText(value) + " s";
  }
  return value == std::trunc(value) ? fmt::format("{:.0f}", value) : ValueText(value);
}

std::string TimesText(double count) {
  if (count == 0) return kNever;
  return count == 1 ? "once" : fmt::format("{:.0f} times", count);
}

std::string ForceText(double force_mN) { return ValueText(force_mN) + " mN"; }

std::string LimitText(double force_mN) { return fmt::format("{:g} mN", force_mN); }

std::string DateText(std::int64_t wall_clock_us) {
  constexpr std::int64_t kYear2100Us = 4'102'444'800'000'000;
  if (wall_clock_us <= 0 || wall_clock_us >= kYear2100Us) return "at an unknown time";
  return fmt::format("{:%Y-%m-%d %H:%M} UTC",
                     fmt::gmtime(static_cast<std::time_t>(wall_clock_us / 1'000'000)));
}

}  // namespace torquer
