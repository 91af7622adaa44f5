#include "host/recorder/session_summary.h"

#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <filesystem>
#include <functional>
#include <nlohmann/json.hpp>
#include <utility>

#include "host/recorder/json_values.h"
#include "host/support/error.h"
#include "host/support/input_file.h"

namespace torquer {
namespace {

// Version 1 had the marks of the live session, which depended on the load of the machine.
constexpr int kSummaryVersion = 2;
constexpr char kEnding[] = ".session.json";
constexpr int kMostEntries = 10'000;  // entries of a folder that are examined
constexpr double kMostValue = 1e12;

// A figure of a summary and its name in the file.
struct SummaryFigure {
  const char* name;
  std::optional<double> SessionSummary::*value;
  bool newer = false;  // summaries of earlier releases lack it
};

constexpr SummaryFigure kSummaryFigures[] = {
    {"target_s", &SessionSummary::target_s},
    {"wall_force_mN", &SessionSummary::wall_force_mN},
    {"fluoroscopy_s", &SessionSummary::fluoroscopy_s},
    {"contrast_mL", &SessionSummary::contrast_mL},
    {"air_kerma_mGy", &SessionSummary::air_kerma_mGy, true},
    {"air_kerma_mGy_min", &SessionSummary::air_kerma_mGy_min, true},
    {"blind_mm", &SessionSummary::blind_mm, true},
    {"blind_s", &SessionSummary::blind_s, true},
    {"retractions", &SessionSummary::retractions, true},
    {"retracted_mm", &SessionSummary::retracted_mm, true},
    {"before_motion_s", &SessionSummary::before_motion_s, true},
    {"on_the_way_s", &SessionSummary::on_the_way_s, true},
    {"after_target_s", &SessionSummary::after_target_s, true},
    {"tip_path_mm", &SessionSummary::tip_path_mm}};

// Sets the times of the phases. All times count from the simulator's start.
void FindPhases(const SessionCourse& course, SessionSummary& summary) {
  const auto between = [](double from_s, double to_s) { return std::max(0.0, to_s - from_s); };
  const double moved_s = course.first_motion_s().value_or(course.end_s());
  summary.before_motion_s = between(course.begin_s(), moved_s);
  if (!course.first_motion_s()) return;
  summary.on_the_way_s = between(moved_s, summary.target_s.value_or(course.end_s()));
  if (summary.target_s) summary.after_target_s = between(*summary.target_s, course.end_s());
}

std::optional<bool> AsTruth(const std::optional<double>& reading) {
  if (!reading) return std::nullopt;
  return *reading != 0;
}

// Reader of the fields of a summary file.
class Fields {
 public:
  Fields(const std::string& path, nlohmann::json json) : path_(path), json_(std::move(json)) {
    if (!json_.is_object()) Refuse("is no JSON object");
  }

  const nlohmann::json& At(const char* name) const {
    const auto found = json_.find(name);
    if (found == json_.end()) Refuse(std::string(name) + " is missing");
    return *found;
  }
  std::string Text(const char* name) const {
    if (!At(name).is_string()) Refuse(std::string(name) + " is not a text");
    return At(name).get<std::string>();
  }
  std::optional<double> Number(const char* name) const {
    const nlohmann::json& value = At(name);
    if (value.is_null()) return std::nullopt;
    if (!value.is_number()) Refuse(std::string(name) + " is not a number");
    const double number = value.get<double>();
    if (!(number >= 0 && number <= kMostValue)) Refuse(std::string(name) + " is out of range");
    return number;
  }
  std::optional<double> Value(const SummaryFigure& figure) const {
    if (figure.newer && !json_.contains(figure.name)) return std::nullopt;
    return Number(figure.name);
  }
  std::string NewerText(const char* name) const {
    return json_.contains(name) ? Text(name) : std::string();
  }
  double GivenNumber(const char* name) const {
    const std::optional<double> number = Number(name);
    if (!number) Refuse(std::string(name) + " is missing");
    return *number;
  }
  const nlohmann::json& List(const char* name) const {
    if (!At(name).is_array()) Refuse(std::string(name) + " is not a list");
    return At(name);
  }
  std::int64_t Count(const char* name) const {
    if (!At(name).is_number_integer() || At(name).get<std::int64_t>() < 0) {
      Refuse(std::string(name) + " is not a count");
    }
    return At(name).get<std::int64_t>();
  }
  // 0 in earlier files: not known.
  std::optional<std::int64_t> Start() const {
    constexpr const char* kName = "started_us";
    if (At(kName).is_null() || Count(kName) == 0) return std::nullopt;
    return Count(kName);
  }
  std::optional<bool> Truth(const char* name) const {
    if (At(name).is_null()) return std::nullopt;
    if (!At(name).is_boolean()) Refuse(std::string(name) + " is neither true nor false");
    return At(name).get<bool>();
  }
  [[noreturn]] void Refuse(const std::string& what) const {
    throw UserError(path_ + ": is not a summary of a session: " + what);
  }

 private:
  const std::string& path_;
  nlohmann::json json_;
};

bool IsOwn(const std::filesystem::path& file) {
  struct stat status {};
  return lstat(file.c_str(), &status) == 0 && S_ISREG(status.st_mode) && status.st_uid == geteuid();
}

// Calls `take` for each entry of a folder; for none if the folder cannot be read.
void LookThrough(const std::filesystem::path& folder,
                 const std::function<void(const std::filesystem::directory_entry&)>& take) {
  std::error_code error;
  std::filesystem::directory_iterator entry(folder, error);
  for (int i = 0; i < kMostEntries && !error && entry != std::filesystem::directory_iterator();
       ++i) {
    take(*entry);
    entry.increment(error);
  }
}

// Sorts names in descending order: the newest come first, because sessions are named by time.
std::vector<std::string> FindSummaries(const std::string& page) {
  namespace fs = std::filesystem;
  const fs::path own = fs::absolute(SummaryPath(page)).lexically_normal();
  std::vector<std::string> found;
  LookThrough(own.parent_path(), [&](const fs::directory_entry& entry) {
    const std::string name = entry.path().filename().string();
    if (name.ends_with(kEnding) && entry.path().filename() != own.filename()) {
      found.push_back(entry.path().string());
    }
  });
  LookThrough(own.parent_path().parent_path(), [&](const fs::directory_entry& entry) {
    std::error_code error;
    if (entry.path() == own.parent_path() || entry.is_symlink(error)) return;
    const fs::path beside = entry.path() / own.filename();
    if (IsOwn(beside)) found.push_back(beside.string());
  });
  std::sort(found.begin(), found.end(), std::greater<>());
  if (found.size() > EarlierSessions::kMostFiles) found.resize(EarlierSessions::kMostFiles);
  return found;
}

}  // namespace

SessionSummary Summarize(const SessionReport& report) {
  const auto reading = [&report](const char* name) { return FindReading(report.readings, name); };
  const SessionCourse& course = report.course;
  SessionSummary summary;
  summary.scene = report.scene;
  if (report.started_us > 0) summary.started_us = report.started_us;
  summary.procedure_s = reading("procedure_s").value_or(course.end_s() - course.begin_s());
  summary.target_reached = AsTruth(reading("target_reached"));
  summary.safe = AsTruth(reading("safe_success"));
  if (summary.target_reached == true) summary.target_s = reading("target_reached_s");
  summary.wall_force_mN = reading("wall_force_largest_ever_mN");
  if (report.Has("fluoroscopy")) {
    summary.fluoroscopy_s = reading("fluoroscopy_s").value_or(course.xray().total_s());
  }
  summary.contrast_mL = reading("contrast_injected_mL");
  summary.air_kerma_mGy = FindOverPlanes(report.readings, "air_kerma_mGy");
  if (summary.air_kerma_mGy && summary.fluoroscopy_s.value_or(0) > 0) {
    summary.air_kerma_mGy_min = *summary.air_kerma_mGy / (*summary.fluoroscopy_s / 60);
  }
  if (report.Has("fluoroscopy")) {
    summary.blind_mm = course.blind().path_mm;
    summary.blind_s = course.blind().time_s;
  }
  summary.retractions = reading("retractions");
  summary.retracted_mm = reading("retracted_mm");
  FindPhases(course, summary);
  summary.tip_path_mm = reading("tip_path_mm");
  // The course also follows ticks that did not converge, so it cannot replace an unknown path.
  const std::vector<std::string>& names = report.readings.names;
  if (std::find(names.begin(), names.end(), "tip_path_mm") == names.end()) {
    summary.tip_path_mm = course.tip_path_mm();
  }
  for (const InstrumentCourse& instrument : course.instruments()) {
    summary.reversals += instrument.reversals;
  }
  if (report.marks) {
    summary.passed = report.marks->Passed();
    for (const Mark& mark : report.marks->marks) {
      summary.marks.push_back({mark.name, mark.value, mark.passed});
    }
  }
  summary.trainee = report.trainee;
  summary.group = report.group;
  summary.examination = report.examination;
  summary.gradable = report.not_gradable.empty();
  if (!summary.gradable) {
    summary.target_reached = summary.safe = std::nullopt;
    summary.target_s = summary.wall_force_mN = summary.tip_path_mm = std::nullopt;
    summary.retractions = summary.retracted_mm = summary.blind_mm = summary.blind_s = std::nullopt;
    summary.before_motion_s = summary.on_the_way_s = summary.after_target_s = std::nullopt;
  }
  return summary;
}

std::string FormatSummary(const SessionSummary& summary) {
  nlohmann::ordered_json marks = nlohmann::ordered_json::array();
  for (const SummaryMark& mark : summary.marks) {
    marks.push_back(
        {{"name", mark.name}, {"value", OrNull(mark.value)}, {"passed", OrNull(mark.passed)}});
  }
  nlohmann::ordered_json json = {{"session_summary", kSummaryVersion},
                                 {"scene", summary.scene},
                                 {"trainee", summary.trainee},
                                 {"group", summary.group},
                                 {"started_us", OrNull(summary.started_us)},
                                 {"examination", summary.examination},
                                 {"gradable", summary.gradable},
                                 {"procedure_s", summary.procedure_s},
                                 {"target_reached", OrNull(summary.target_reached)},
                                 {"safe", OrNull(summary.safe)},
                                 {"reversals", summary.reversals},
                                 {"passed", OrNull(summary.passed)},
                                 {"marks", std::move(marks)}};
  for (const SummaryFigure& figure : kSummaryFigures)
    json[figure.name] = OrNull(summary.*figure.value);
  return json.dump(-1, ' ', false, nlohmann::json::error_handler_t::replace) + "\n";
}

SessionSummary ReadSummary(const std::string& path) {
  const Fields fields(
      path, nlohmann::json::parse(
                ReadInputFile(path, "restore the file, or delete it", EarlierSessions::kMostBytes),
                nullptr, false));
  if (fields.Count("session_summary") != kSummaryVersion) fields.Refuse("it has another version");
  SessionSummary summary;
  summary.scene = fields.Text("scene");
  summary.trainee = fields.NewerText("trainee");
  summary.group = fields.NewerText("group");
  summary.started_us = fields.Start();
  summary.examination = fields.Truth("examination").value_or(false);
  summary.gradable = fields.Truth("gradable").value_or(false);
  summary.procedure_s = fields.GivenNumber("procedure_s");
  summary.target_reached = fields.Truth("target_reached");
  summary.safe = fields.Truth("safe");
  for (const SummaryFigure& figure : kSummaryFigures) summary.*figure.value = fields.Value(figure);
  summary.reversals = fields.Count("reversals");
  summary.passed = fields.Truth("passed");
  for (const nlohmann::json& mark : fields.List("marks")) {
    const Fields of_mark(path, mark);
    summary.marks.push_back(
        {of_mark.Text("name"), of_mark.Number("value"), of_mark.Truth("passed")});
  }
  return summary;
}

std::string SummaryPath(const std::string& page) {
  return std::filesystem::path(page).replace_extension(kEnding).string();
}

EarlierSessions ReadEarlierSessions(const std::string& page, const SessionSummary& now) {
  EarlierSessions earlier;
  for (const std::string& path : FindSummaries(page)) {
    try {
      const SessionSummary summary = ReadSummary(path);
      if (summary.scene == now.scene && summary.trainee == now.trainee &&
          summary.started_us < now.started_us) {
        earlier.sessions.push_back(summary);
      }
    } catch (const UserError& error) {
      if (earlier.refused.size() < EarlierSessions::kMostRefused) {
        earlier.refused.emplace_back(error.what());
      }
    }
  }
  std::vector<SessionSummary>& sessions = earlier.sessions;
  std::sort(sessions.begin(), sessions.end(), [](const SessionSummary& a, const SessionSummary& b) {
    return a.started_us < b.started_us;
  });
  if (sessions.size() > EarlierSessions::kMost) {
    sessions.erase(sessions.begin(), sessions.end() - EarlierSessions::kMost);
  }
  return earlier;
}

}  // namespace torquer
