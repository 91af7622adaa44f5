// A session in a few figures, kept beside its page so that later sessions can be compared with it.
#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "host/recorder/session_report.h"

namespace torquer {

/// What learning shows in. Nothing where the scene does not measure it.
struct SessionSummary {
  std::string scene;
  std::int64_t started_us = 0;  ///< wall clock, since 1970
  double procedure_s = 0;       ///< as assessed, otherwise from the first tick to the last
  std::optional<bool> target_reached;
  std::optional<bool> safe;  ///< reached, and no force above the limit
  std::optional<double> target_s;
  std::optional<double> wall_force_mN;  ///< largest, of a patch
  std::optional<double> fluoroscopy_s;  ///< time with the X-ray pedal down
  std::optional<double> contrast_mL;    ///< injected
  double tip_path_mm = 0;               ///< as assessed, otherwise the course's
  std::int64_t reversals = 0;           ///< of all instruments

  bool operator==(const SessionSummary&) const = default;
};

/// The figures of a session: those of its assessment where it has one.
SessionSummary Summarize(const SessionReport& report);

/// As one JSON object, the line ended.
std::string FormatSummary(const SessionSummary& summary);

/// The file at `path`, which FormatSummary wrote. Throws UserError naming the file and what is
/// wrong with it.
SessionSummary ReadSummary(const std::string& path);

/// Where the summary of a session lies whose page is `page`: "report.html" has
/// "report.session.json" beside it.
std::string SummaryPath(const std::string& page);

/// Earlier sessions of the same scene.
struct EarlierSessions {
  static constexpr std::size_t kMost = 30;          ///< sessions, the newest
  static constexpr std::size_t kMostFiles = 500;    ///< that are read
  static constexpr std::size_t kMostBytes = 16384;  ///< of one file
  static constexpr std::size_t kMostRefused = 10;   ///< that are named

  std::vector<SessionSummary> sessions;  ///< in the order in which they began
  std::vector<std::string> refused;      ///< damaged files: which, and what is wrong
};

/// Reads the summaries that may belong to sessions before `now`, whose page is `page`: all
/// NAME.session.json in the folder of the page, and, of the folders beside that one, the file named
/// as the page's own where it belongs to the same user. Sessions of other scenes, `now` itself and
/// later ones are left out. Never throws UserError: what cannot be read is in `refused`.
EarlierSessions ReadEarlierSessions(const std::string& page, const SessionSummary& now);

}  // namespace torquer
