#include "host/recorder/page_text.h"

#include <fmt/chrono.h>
#include <fmt/format.h>

#include <cmath>
#include <ctime>

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

std::string TimesText(double count) {
  if (count == 0) return "never";
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
