// Session summary: a few figures, kept beside the page for comparison with later sessions.
#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "host/recorder/session_report.h"

namespace torquer {

/// One pass mark of a session. Values without a number or a verdict are not known.
struct SummaryMark {
  std::string name;  ///< key of the file with the pass marks
  std::optional<double> value;
  std::optional<bool> passed;

  bool operator==(const SummaryMark&) const = default;
};

/// Figures that show learning progress. A figure has no value if the scene does not measure it, or
/// if it is not known.
struct SessionSummary {
  std::string scene;
  std::string trainee;                     ///< "": not named
  std::string group;                       ///< of the trainee, such as a course; "": none
  std::optional<std::int64_t> started_us;  ///< wall clock, since 1970
  bool examination = false;                ///< otherwise practice
  /// False: the session could not be repeated, so it has no marks.
  bool gradable = true;
  double procedure_s = 0;  ///< from the assessment, otherwise from the first tick to the last
  std::optional<bool> target_reached;
  std::optional<bool> safe;  ///< target reached, and no force above the limit
  std::optional<double> target_s;
  std::optional<double> wall_force_mN;      ///< largest wall force of a patch
  std::optional<double> fluoroscopy_s;      ///< time with the X-ray pedal down
  std::optional<double> contrast_mL;        ///< injected
  std::optional<double> air_kerma_mGy;      ///< at the reference point, over all planes
  std::optional<double> air_kerma_mGy_min;  ///< its mean rate while the pedal was down
  std::optional<double> blind_mm;      ///< motion of the hands without X-ray, in a scene with X-ray
  std::optional<double> blind_s;       ///< time of that motion
  std::optional<double> retractions;   ///< of the assessed instrument
  std::optional<double> retracted_mm;  ///< all its motion back
  std::optional<double> before_motion_s;  ///< from the beginning until an instrument first moved
  std::optional<double> on_the_way_s;     ///< from there to the target, or to the end
  std::optional<double> after_target_s;   ///< from the target to the end
  std::optional<double> tip_path_mm;      ///< from the assessment, otherwise from the course
  std::int64_t reversals = 0;             ///< of all instruments
  std::optional<bool> passed;             ///< all pass marks; empty: unknown, or no marks are set
  std::vector<SummaryMark> marks;

  bool operator==(const SessionSummary&) const = default;
};

/// Summarizes a session; uses the figures of its assessment if it has one.
SessionSummary Summarize(const SessionReport& report);

/// Formats one JSON object on a line that ends with a newline.
std::string FormatSummary(const SessionSummary& summary);

/// Reads the file at `path`, written by FormatSummary. Throws UserError with the file and its
/// error.
SessionSummary ReadSummary(const std::string& path);

/// Path of the summary of `page`: "report.html" has "report.session.json" beside it.
std::string SummaryPath(const std::string& page);

/// Earlier sessions of the same scene.
struct EarlierSessions {
  static constexpr std::size_t kMost = 30;          ///< sessions; the newest are kept
  static constexpr std::size_t kMostFiles = 500;    ///< files that are read
  static constexpr std::size_t kMostBytes = 16384;  ///< of one file
  static constexpr std::size_t kMostRefused = 10;   ///< damaged files that are named

  std::vector<SessionSummary> sessions;  ///< in the order in which they began
  std::vector<std::string> refused;      ///< damaged files, each with its error
};

/// Reads the summaries of earlier sessions than `now`, the session of `page`. It reads all
/// NAME.session.json in the page's folder. In each sibling folder it reads the file named like the
/// page's own summary. The same user must own that file. Sessions of other scenes, `now` itself and
/// later sessions are excluded, and sessions of other trainees. Never throws UserError: unreadable
/// files are listed in `refused`.
EarlierSessions ReadEarlierSessions(const std::string& page, const SessionSummary& now);

}  // namespace torquer
