// Pass marks: limits that a trainer sets in a file, and how a session compares with them.
#pragma once

#include <optional>
#include <string>
#include <vector>

namespace torquer {

struct SessionReport;

/// A limit, and the session's value.
struct Mark {
  std::string name;             ///< key in the file, such as "largest_force_mN"
  std::string label;            ///< for people: "Largest force on the wall"
  std::string reading;          ///< of the scene's observers
  std::string limit;            ///< with its unit: "at most 300 mN"
  std::string found;            ///< with its unit; "not known"
  std::optional<double> most;   ///< largest value that passes; none for target_reached
  std::optional<double> value;  ///< of the session; empty: unknown
  std::optional<bool> passed;   ///< empty: unknown, as in a session that is not gradable
};

/// All marks of a session.
struct MarkSheet {
  std::string file;         ///< with the pass marks
  std::vector<Mark> marks;  ///< in the order of the documentation

  /// False if a mark is failed, true if all are passed, otherwise nullopt.
  std::optional<bool> Passed() const;
};

/// File that holds the pass marks of a scene file by default: pass_marks/NAME.toml beside it.
std::string PassMarksPath(const std::string& scene_file);

/// Reads the pass marks in `path` for the scene of `report`. Throws UserError for an unknown key
/// and a value out of range. It also throws for a mark that the scene does not measure, and a file
/// without a mark. The message names file, line, key, value and remedy.
MarkSheet ReadMarks(const std::string& path, const SessionReport& report);

/// Fills in the values of the session and the verdicts. A session that is not gradable has neither.
void CompareMarks(const SessionReport& report, MarkSheet& sheet);

/// "passed", "failed", or "not known".
std::string PassedText(const std::optional<bool>& passed);

}  // namespace torquer
