#include "tests/recorder/page_fixture.h"

#include <algorithm>
#include <catch2/catch.hpp>
#include <cstdlib>
#include <fstream>

#include "host/recorder/session_log.h"
#include "tests/recorder/session_fixture.h"
#include "tests/support/temporary_folder.h"

namespace torquer::test {

SessionReport PageReport(bool course) {
  const TemporaryFolder folder;
  SessionFaults faults;
  faults.course = course;
  WriteSession(folder.Path("log"), faults);
  SessionReporter reporter;
  ReadSessionLog(folder.Path("log"), reporter.Handlers());
  SessionReport report = reporter.Finish([](const std::string&, int) -> Eigen::Matrix2d {
    return Eigen::Vector2d(kMmPerCount, kRadPerCount).asDiagonal();
  });
  report.started_us = kStartedUs;
  return report;
}

PageParts PagePartsOfCourse() {
  PageParts parts;
  parts.log = "/somewhere/session.lcmlog";
  parts.limits.target_centerline = "lad";
  parts.limits.target_at_mm = 95;
  parts.limits.target_radius_mm = 3;
  parts.limits.force_limit_mN = 100;
  parts.limits.patch_mm = 2;
  parts.limits.threshold_mN = 30;
  return parts;
}

void SetReading(SessionReport& report, const std::string& name, double value) {
  const auto found = std::find(report.readings.names.begin(), report.readings.names.end(), name);
  REQUIRE(found != report.readings.names.end());
  report.readings.values[static_cast<std::size_t>(found - report.readings.names.begin())] = value;
}

bool IsXml(const std::string& text) {
  const TemporaryFolder folder;
  std::ofstream(folder.Path("page")) << text;
  const std::string command =
      "python3 -c 'import sys, xml.dom.minidom; xml.dom.minidom.parse(sys.argv[1])' " +
      folder.Path("page") + " 2>/dev/null";
  return std::system(command.c_str()) == 0;
}

}  // namespace torquer::test
