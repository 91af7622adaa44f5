// Text formatting for a session's page, report and clip: figures with their units, escaped.
#pragma once

#include <cstdint>
#include <string>
#include <string_view>

namespace torquer {

/// Untrusted text, such as from a log: invisible characters are made visible, markup is escaped.
std::string SafeText(std::string_view text);
/// Time as min:s: "0:41.2 min"; from 100 s on "3:05 min".
std::string SecondsText(double seconds);
/// Three significant digits, or all digits before the point: "41.2", "0.314", "1250".
std::string ValueText(double value);
/// Value of a reading with the unit at the end of its name, such as "41.2 mN". Times are as by
/// SecondsText, and counts are whole numbers. NaN gives "not known".
std::string ReadingText(std::string_view name, double value);
/// Text for the time of an event that has not happened.
inline constexpr char kNever[] = "never";
/// "never", "once", "3 times".
std::string TimesText(double count);
/// "41.2 mN".
std::string ForceText(double force_mN);
/// Limit as a round number: "100 mN".
std::string LimitText(double force_mN);
/// "2026-11-23 04:39 UTC" from microseconds since 1970; outside 1970 to 2100 "at an unknown time".
std::string DateText(std::int64_t wall_clock_us);

}  // namespace torquer
