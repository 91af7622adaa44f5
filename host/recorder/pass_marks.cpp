#include "host/recorder/pass_marks.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <filesystem>

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
};
constexpr std::array<MarkKey, 10> kMarkKeys = {
    {{"time_to_target_s", "Time to the target", "target_reached_s", "assessment"},
     {"procedure_s", "Duration of the procedure", "procedure_s", "assessment"},
     {"largest_force_mN", "Largest force on the wall", "wall_force_largest_ever_mN", "wall_force"},
     {"force_events", "Force above the scene's threshold", "wall_force_events", "wall_force"},
     {"fluoroscopy_s", "Fluoroscopy time", "fluoroscopy_s", "assessment"},
     {"air_kerma_mGy", "Air kerma at the reference point", "air_kerma_mGy", "fluoroscopy"},
     {"contrast_mL", "Contrast agent", "contrast_injected_mL", "contrast"},
     {"path_ratio", "Path of the tip over the length of the route", "tip_path_ratio", "assessment"},
     {"wrong_vessels", "Wrong vessels entered", "wrong_vessel_entries", "assessment"},
     {"retractions", "Retractions of 2 mm or more", "retractions", "assessment"}}};
constexpr char kTargetReached[] = "target_reached";

// Fills in the verdict on a mark whose value is known.
void JudgeMark(Mark& mark) {
  if (!mark.most) {
    mark.passed = *mark.value != 0;
    mark.found = *mark.passed ? "reached" : "not reached";
    return;
  }
  mark.found = ReadingText(mark.reading, *mark.value);
  // A negative time: it never happened.
  const bool never = *mark.value < 0;
  mark.passed = !never && *mark.value <= *mark.most;
  if (never) mark.value.reset();
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
  for (Mark& mark : sheet.marks) {
    mark.value = FindReading(report.readings, mark.reading);
    if (mark.value) JudgeMark(mark);
  }
}

std::string PassedText(const std::optional<bool>& passed) {
  return !passed ? "not known" : *passed ? "passed" : "failed";
}

}  // namespace torquer
