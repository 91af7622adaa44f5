// Texts and figures of a session's page, before layout. All texts are escaped and carry their
// units.
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "host/recorder/session_limits.h"
#include "host/recorder/session_report.h"
#include "host/recorder/session_summary.h"

namespace torquer {

/// Outcome as a headline and some sentences.
struct PageVerdict {
  enum class Kind { kGood, kPoor, kOpen };  ///< open: the scene sets no task
  Kind kind = Kind::kOpen;
  std::string headline;
  std::string text;
};

/// One measure: its value, its limit, and the meaning of the result ("" for none).
struct PageFinding {
  std::string name;
  std::string found;
  std::string limit;
  std::string meaning;
};

/// Figure: its name, and its value with the unit.
struct PageRow {
  std::string name;
  std::string value;
};

/// Texts and figures of one session. The constructor's arguments must outlive this object.
class PageFigures {
 public:
  /// `scene_changed`: the limits may differ from those of the session.
  PageFigures(const SessionReport& report, const SessionLimits& limits, bool scene_changed)
      : report_(report), limits_(limits), scene_changed_(scene_changed), now_(Summarize(report)) {}

  const SessionSummary& summary() const { return now_; }
  PageVerdict Verdict() const;
  /// Reasons why the figures may not show the trainee's actions; one sentence each.
  std::vector<std::string> Doubts() const;
  /// Findings of the assessment and of the wall force. Empty if the scene has neither, or if the
  /// session is not gradable.
  std::vector<PageFinding> Findings() const;
  std::vector<PageRow> Radiation() const;
  /// Time per phase, and motion without X-ray; empty if the session is not gradable.
  std::vector<PageRow> Phases() const;
  std::vector<PageRow> Motion() const;
  std::vector<PageRow> Solver() const;
  std::vector<PageRow> Device() const;
  /// Path length of the tip with its unit; "not known" without a value.
  std::string TipPath() const;
  /// Length of wire over which the wall force is measured, in words.
  std::string Patch() const;
  /// Value of a reading in the last message; nullopt if absent.
  std::optional<double> Reading(const char* name) const;

 private:
  bool AboveLimit() const;
  void AddTarget(std::vector<PageFinding>& findings) const;
  void AddWall(std::vector<PageFinding>& findings) const;
  void AddWay(std::vector<PageFinding>& findings) const;
  std::string Share(std::int64_t ticks) const;

  const SessionReport& report_;
  const SessionLimits& limits_;
  const bool scene_changed_;
  const SessionSummary now_;
};

}  // namespace torquer
