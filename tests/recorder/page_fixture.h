// Report of the artificial session, for tests of pages.
#pragma once

#include <cstdint>
#include <string>

#include "host/recorder/report_page.h"
#include "host/recorder/session_report.h"

namespace torquer::test {

inline constexpr std::int64_t kStartedUs = 1'700'000'000'000'000;  // 2023-11-14 22:13:20 UTC

/// Report of WriteSession; `course`: with the data for a page.
SessionReport PageReport(bool course);
/// Limits of a scene for PageReport.
PageParts PagePartsOfCourse();
/// Sets a reading of the last message.
void SetReading(SessionReport& report, const std::string& name, double value);
bool IsXml(const std::string& text);

}  // namespace torquer::test
