// How the page of a session writes its figures: each with its unit, and escaped.
#pragma once

#include <cstdint>
#include <string>
#include <string_view>

namespace torquer {

/// Text of any origin, such as a log: what cannot be seen made visible, markup escaped.
std::string SafeText(std::string_view text);
/// "41.2 s"; from 100 s on "3 min 05 s".
std::string SecondsText(double seconds);
/// "never", "once", "3 times".
std::string TimesText(double count);
/// "41.2 mN", below 10 mN "3.14 mN".
std::string ForceText(double force_mN);
/// A limit is a round number and stays one: "100 mN".
std::string LimitText(double force_mN);
/// "2026-11-23 04:39 UTC" of microseconds since 1970; beyond 1970 to 2100 "at an unknown time".
std::string DateText(std::int64_t wall_clock_us);

}  // namespace torquer
