// What the page of a session says in words and numbers, before it is laid out. All texts are
// escaped and carry their units.
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "host/recorder/session_limits.h"
#include "host/recorder/session_report.h"
#include "host/recorder/session_summary.h"

namespace torquer {

/// The outcome in a headline and some sentences.
struct PageVerdict {
  enum class Kind { kGood, kPoor, kOpen };  ///< open: the scene sets no task
  Kind kind = Kind::kOpen;
  std::string headline;
  std::string text;
};

/// A measure: what was found, what it is held to, and what that means ("" for nothing).
struct PageFinding {
  std::string name;
  std::string found;
  std::string limit;
  std::string meaning;
};

/// A figure: its name, and its value with the unit.
struct PageRow {
  std::string name;
  std::string value;
};

/// All of it of one session. What it is given must outlive it.
class PageFigures {
 public:
  /// `scene_changed`: the limits are no longer those that the session had.
  PageFigures(const SessionReport& report, const SessionLimits& limits, bool scene_changed)
      : report_(report), limits_(limits), scene_changed_(scene_changed), now_(Summarize(report)) {}

  const SessionSummary& summary() const { return now_; }
  PageVerdict Verdict() const;
  /// Why the figures may not be what the trainee did; a sentence each.
  std::vector<std::string> Doubts() const;
  /// Of the assessment and of the force on the wall; empty where the scene has neither.
  std::vector<PageFinding> Findings() const;
  std::vector<PageRow> Radiation() const;
  std::vector<PageRow> Motion() const;
  std::vector<PageRow> Solver() const;
  std::vector<PageRow> Device() const;
  /// Where the force on the wall was taken, in words.
  std::string Patch() const;
  /// A reading of the last message.
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
