#include "host/recorder/pass_marks.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <filesystem>

#include "host/bus/event_times.h"
#include "host/recorder/page_text.h"
#include "host/recorder/session_report.h"
#include "host/support/error.h"
#include "host/support/strict_toml.h"

namespace torquer {
namespace {

constexpr double kLargestMark = 1e9;

// Key of [at_most]: its reading, and the effect that publishes this reading.
struct MarkKey {
  const char* name;
  const char* label;
  const char* reading;
  const char* effect;
  // Only ticks that converged count. So the value is a lower bound if others did not.
  bool is_of_converged_ticks = false;
};
constexpr std::array<MarkKey, 10> kMarkKeys = {
    {{"time_to_target_s", "Time to the target", "target_reached_s", "assessment"},
     {"procedure_s", "Duration of the procedure", "procedure_s", "assessment"},
     {"largest_force_mN", "Largest force on the wall", "wall_force_largest_ever_mN", "wall_force",
      true},
     {"force_events", "Force above the scene's threshold", "wall_force_events", "wall_force", true},
     {"fluoroscopy_s", "Fluoroscopy time", "fluoroscopy_s", "assessment"},
     {"air_kerma_mGy", "Air kerma at the reference point", "air_kerma_mGy", "fluoroscopy"},
     {"contrast_mL", "Contrast agent", "contrast_injected_mL", "contrast"},
     {"path_ratio", "Path of the tip over the length of the route", "tip_path_ratio", "assessment",
      true},
     {"wrong_vessels", "Wrong vessels entered", "wrong_vessel_entries", "assessment", true},
     {"retractions", "Retractions of 2 mm or more", "retractions", "assessment"}}};
constexpr char kTargetReached[] = "target_reached";

bool IsOfConvergedTicks(const Mark& mark) {
  return std::any_of(kMarkKeys.begin(), kMarkKeys.end(), [&](const MarkKey& key) {
    return key.is_of_converged_ticks && mark.name == key.name;
  });
}

// Fills in the verdict on a mark of an event that has not happened.
void JudgeMissed(Mark& mark) {
  mark.found = kNever;
  mark.passed = false;
}

// Fills in the verdict on a mark whose value is known. `is_lower_bound`: the true value may be
// larger, so the mark can be failed and cannot be passed.
void JudgeMark(Mark& mark, bool is_lower_bound) {
  if (!mark.most) {
    mark.passed = *mark.value != 0;
    mark.found = *mark.passed ? "reached" : "not reached";
    return;
  }
  mark.found = ReadingText(mark.reading, *mark.value);
  mark.passed = *mark.value <= *mark.most;
  if (!is_lower_bound) return;
  mark.found = "at least " + mark.found;
  if (*mark.passed) mark.passed.reset();
}

Mark Unjudged(const char* name, const char* label, const char* reading, const std::string& limit,
              std::optional<double> most) {
  return {.name = name,
          .label = label,
          .reading = reading,
          .limit = limit,
          .found = "not known",
          .most = most,
          .value = {},
          .passed = {}};
}

void RequireEffect(const SessionReport& report, const StrictTable& table, const char* key,
                   const std::string& effect) {
  if (report.Has(effect)) return;
  table.Refuse(key, fmt::format("the scene {} does not measure it; remove this line, or add "
                                "[effects.{}] to the scene",
                                report.scene, effect));
}

}  // namespace

std::optional<bool> MarkSheet::Passed() const {
  const auto is = [](bool wanted) {
    return [wanted](const Mark& mark) { return mark.passed == wanted; };
  };
  if (std::any_of(marks.begin(), marks.end(), is(false))) return false;
  if (std::all_of(marks.begin(), marks.end(), is(true))) return true;
  return std::nullopt;
}

std::string PassMarksPath(const std::string& scene_file) {
  const std::filesystem::path scene(scene_file);
  return (scene.parent_path() / "pass_marks" / (scene.stem().string() + ".toml")).string();
}

MarkSheet ReadMarks(const std::string& path, const SessionReport& report) {
  StrictTable file = StrictTable::Read(path);
  MarkSheet sheet{.file = path, .marks = {}};
  if (file.Boolean(kTargetReached, false)) {
    RequireEffect(report, file, kTargetReached, "assessment");
    sheet.marks.push_back(Unjudged(kTargetReached, "Target", kTargetReached, "reached", {}));
  }
  if (StrictTable* limits = file.OptionalTable("at_most")) {
    for (const MarkKey& key : kMarkKeys) {
      // Also of a key that is missing: the error of an unknown one then names it.
      const double most = limits->Number(key.name, 0, kLargestMark, -1);
      if (!limits->Has(key.name)) continue;
      RequireEffect(report, *limits, key.name, key.effect);
      sheet.marks.push_back(Unjudged(key.name, key.label, key.reading,
                                     "at most " + ReadingText(key.reading, most), most));
    }
  }
  file.RefuseUnread();
  if (sheet.marks.empty()) {
    throw UserError(path +
                    ": holds no pass mark; set target_reached = true or a limit in [at_most], or "
                    "remove the file");
  }
  return sheet;
}

void CompareMarks(const SessionReport& report, MarkSheet& sheet) {
  if (!report.not_gradable.empty()) return;
  const bool all_converged =
      FindReading(report.readings, "wall_force_unconverged_s").value_or(0) == 0;
  for (Mark& mark : sheet.marks) {
    mark.value = FindOverPlanes(report.readings, mark.reading);
    if (mark.value) JudgeMark(mark, !all_converged && IsOfConvergedTicks(mark));
    if (bus::NeverHappened(report.readings, mark.reading)) JudgeMissed(mark);
  }
}

std::string PassedText(const std::optional<bool>& passed) {
  return !passed ? "not known" : *passed ? "passed" : "failed";
}

}  // namespace torquer
