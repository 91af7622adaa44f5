#include "host/viewer/case_station.h"

#include <fmt/chrono.h>
#include <fmt/format.h>

#include <algorithm>
#include <chrono>
#include <csignal>
#include <ctime>
#include <nlohmann/json.hpp>
#include <thread>
#include <tuple>

#include "host/simulator/scene/scene_spec.h"
#include "host/support/error.h"
#include "host/support/input_file.h"
#include "host/support/printable_text.h"

namespace torquer::viewer {
namespace {

namespace fs = std::filesystem;

constexpr std::size_t kMostCases = 64;
constexpr std::int64_t kMostPictureBytes = 200'000;
constexpr std::int64_t kMostReportBytes = std::int64_t{64} << 20;
// Time to end: a program that does not end within it is killed. A simulator stores its field, a
// recorder the last messages.
constexpr std::int64_t kEndUs = 10'000'000;
// Longest wait for a last report while the viewer ends.
constexpr std::int64_t kLastReportUs = 30'000'000;
constexpr std::int64_t kStrangerUs = 300'000;
constexpr std::size_t kLastOutputBytes = 400;
constexpr std::int64_t kLookForRoomUs = 2'000'000;

std::string PictureOf(const fs::path& folder, const std::string& name) {
  const fs::path path = folder / "pictures" / (name + ".jpg");
  if (!fs::exists(path)) return "";
  return ReadInputFile(path.string(), "draw it again, or remove it", kMostPictureBytes);
}

// Makes a new folder, named by the time. A second folder of the same second gets a number.
fs::path NewFolder(const fs::path& parent) {
  std::error_code error;
  fs::create_directories(parent, error);
  const std::string time = fmt::format("{:%Y%m%d-%H%M%S}", fmt::localtime(std::time(nullptr)));
  for (int k = 1; k < 100 && !error; ++k) {
    const fs::path folder = parent / (k == 1 ? time : fmt::format("{}-{}", time, k));
    if (fs::create_directory(folder, error)) return folder;
  }
  throw UserError(fmt::format("{}: no folder can be made there{}; give --sessions another one",
                              parent.string(), error ? ": " + error.message() : ""));
}

const char* Name(CaseStation::Phase phase) {
  switch (phase) {
    case CaseStation::Phase::kChoose:
      return "choose";
    case CaseStation::Phase::kStarting:
      return "starting";
    case CaseStation::Phase::kRunning:
      return "running";
    case CaseStation::Phase::kEnding:
      return "ending";
    case CaseStation::Phase::kEnded:
      return "ended";
  }
  return "";
}

}  // namespace

std::vector<Case> ReadCases(const fs::path& folder, std::vector<std::string>& problems) {
  std::error_code error;
  std::vector<fs::path> files;
  for (fs::directory_iterator entry(folder, error), end; !error && entry != end;
       entry.increment(error)) {
    if (entry->path().extension() == ".toml") files.push_back(entry->path());
  }
  if (error) {
    throw UserError(fmt::format("{}: cannot be read: {}; give --cases a folder of scenes",
                                folder.string(), error.message()));
  }
  std::vector<Case> cases;
  for (const fs::path& file : files) {
    try {
      const scene::SceneSpec spec = scene::ReadScene(file.string());
      if (!spec.training_case) continue;
      Case found{.name = file.stem().string(),
                 .file = file.string(),
                 .title = spec.training_case->title,
                 .task = spec.training_case->task,
                 .difficulty = spec.training_case->difficulty,
                 .xray = spec.Has("fluoroscopy"),
                 .assessed = spec.Has("assessment"),
                 .instruments = {},
                 .picture = PictureOf(folder, file.stem().string())};
      for (const auto& instrument : spec.instruments) found.instruments.push_back(instrument.name);
      cases.push_back(std::move(found));
    } catch (const UserError& problem) {
      problems.emplace_back(problem.what());
    }
  }
  if (cases.empty()) {
    throw UserError(
        fmt::format("{}: has no scene with a section [case]; write one, or start with "
                    "--scene{}",
                    folder.string(), problems.empty() ? "" : "; " + problems.front()));
  }
  std::sort(cases.begin(), cases.end(), [](const Case& a, const Case& b) {
    return std::tie(a.difficulty, a.title, a.name) < std::tie(b.difficulty, b.title, b.name);
  });
  if (cases.size() > kMostCases) {
    problems.push_back(fmt::format("{}: has {} cases, of which the first {} are shown",
                                   folder.string(), cases.size(), kMostCases));
    cases.resize(kMostCases);
  }
  return cases;
}

CaseStation::CaseStation(std::vector<Case> cases, fs::path sessions, Programs programs)
    : cases_(std::move(cases)), sessions_(std::move(sessions)), programs_(std::move(programs)) {
  std::error_code error;
  fs::create_directories(sessions_, error);
  if (error) {
    throw UserError(fmt::format("{}: cannot be made: {}; give --sessions another folder",
                                sessions_.string(), error.message()));
  }
}

CaseStation::~CaseStation() {
  std::int64_t now_us = since_us_;
  report_us_ = kLastReportUs;
  for (End(now_us); phase_ == Phase::kEnding; now_us += 10'000) {
    Advance(now_us);
    std::this_thread::sleep_for(std::chrono::milliseconds(10));
  }
}

const Case* CaseStation::chosen() const { return runs_ == 0 ? nullptr : &cases_[chosen_]; }

bool CaseStation::Start(std::size_t number, std::int64_t now_us, bool examination) {
  if (phase_ != Phase::kChoose && phase_ != Phase::kEnded) return false;
  if (number >= cases_.size() || (examination && !cases_[number].xray)) return false;
  chosen_ = number;
  examination_ = examination;
  ++runs_;
  changed_ = true;
  report_.reset();
  reporter_.reset();
  problem_.clear();
  phase_ = Phase::kEnded;
  looked_us_ = now_us;
  if (stranger_us_ && now_us - *stranger_us_ < kStrangerUs) {
    problem_ =
        "another torquer-simulator publishes on this network; end it, or start the viewer with "
        "another --lcm-url";
    return true;
  }
  if (!HasRoom()) return true;
  try {
    Begin(now_us);
    phase_ = Phase::kStarting;
  } catch (const UserError& error) {
    problem_ = error.what();
  }
  return true;
}

bool CaseStation::HasRoom() {
  std::int64_t free_bytes = 0;
  if (programs_.free_bytes) {
    free_bytes = programs_.free_bytes();
  } else {
    std::error_code error;
    const fs::space_info space = fs::space(sessions_, error);
    if (error) return true;  // the program that writes there reports the error
    free_bytes = static_cast<std::int64_t>(space.available);
  }
  if (free_bytes >= kLeastFreeBytes) return true;
  problem_ = fmt::format(
      "{}: {:.1f} GB are free there, and a session needs {:.0f}; remove old sessions, or give "
      "--sessions a folder on another disk",
      sessions_.string(), 1e-9 * static_cast<double>(free_bytes),
      1e-9 * static_cast<double>(kLeastFreeBytes));
  return false;
}

void CaseStation::Begin(std::int64_t now_us) {
  began_us_ = since_us_ = now_us;
  folder_ = NewFolder(sessions_ / cases_[chosen_].name);
  std::vector<std::string> words = {(programs_.folder / "torquer-recorder").string(),
                                    (folder_ / "session.lcmlog").string(), "--shapes", "60"};
  if (!programs_.lcm_url.empty()) words.insert(words.end(), {"--lcm-url", programs_.lcm_url});
  recorder_ = std::make_unique<ChildProgram>(words, (folder_ / "recorder.log").string());
}

bool CaseStation::End(std::int64_t now_us) {
  if (phase_ != Phase::kStarting && phase_ != Phase::kRunning) return false;
  phase_ = Phase::kEnding;
  since_us_ = now_us;
  changed_ = true;
  (simulator_ != nullptr ? simulator_ : recorder_)->Signal(SIGTERM);
  return true;
}

bool CaseStation::Close() {
  if (phase_ != Phase::kEnded) return false;
  phase_ = Phase::kChoose;
  report_.reset();
  problem_.clear();
  changed_ = true;
  return true;
}

void CaseStation::SawState(std::int64_t now_us) {
  if (phase_ == Phase::kChoose || phase_ == Phase::kEnded) stranger_us_ = now_us;
  if (phase_ != Phase::kStarting || simulator_ == nullptr) return;
  phase_ = Phase::kRunning;
  changed_ = true;
}

bool CaseStation::Advance(std::int64_t now_us) {
  const Phase before = phase_;
  if (phase_ == Phase::kStarting && simulator_ == nullptr) AdvanceRecorder(now_us);
  if (phase_ == Phase::kStarting || phase_ == Phase::kRunning) AdvanceSimulator(now_us);
  if (phase_ == Phase::kRunning && now_us - looked_us_ >= kLookForRoomUs) {
    looked_us_ = now_us;
    if (!HasRoom()) End(now_us);
  }
  if (phase_ == Phase::kEnding) AdvanceEnding(now_us);
  const bool changed = changed_ || phase_ != before;
  changed_ = false;
  return changed;
}

// The simulator starts after the log exists, so that the log is complete.
void CaseStation::AdvanceRecorder(std::int64_t now_us) {
  if (!fs::exists(folder_ / "session.lcmlog")) return;
  std::vector<std::string> words = {(programs_.folder / "torquer-simulator").string(), "--scene",
                                    cases_[chosen_].file};
  if (cases_[chosen_].assessed) {
    words.insert(words.end(), {"--record", (folder_ / "record.json").string()});
    if (examination_) words.emplace_back("--examination");
  }
  if (!programs_.lcm_url.empty()) words.insert(words.end(), {"--lcm-url", programs_.lcm_url});
  try {
    simulator_ = std::make_unique<ChildProgram>(words, (folder_ / "simulator.log").string());
  } catch (const UserError& error) {
    problem_ = error.what();
    End(now_us);
  }
}

void CaseStation::AdvanceSimulator(std::int64_t now_us) {
  if (recorder_->Ended()) {
    Fail("torquer-recorder", *recorder_);
  } else if (simulator_ != nullptr && simulator_->Ended()) {
    Fail("torquer-simulator", *simulator_);
  } else {
    return;
  }
  End(now_us);
}

void CaseStation::Fail(const std::string& program, ChildProgram& ended) {
  const int status = ended.Ended().value_or(0);
  if (status >= 128) {
    problem_ = fmt::format("{} has ended too early, killed by signal {}", program, status - 128);
    return;
  }
  std::string said = ended.LastOutput(kLastOutputBytes);
  while (said.ends_with('\n')) said.pop_back();
  problem_ = fmt::format("{} has ended too early, with status {}: {}", program, status,
                         said.substr(said.rfind('\n') + 1));
}

// Ends the programs in order: simulator, recorder, report.
void CaseStation::AdvanceEnding(std::int64_t now_us) {
  if (simulator_ != nullptr) {
    if (!simulator_->Ended()) return Stop(*simulator_, now_us);
    simulator_.reset();
    recorder_->Signal(SIGTERM);
    since_us_ = now_us;
  }
  if (recorder_ != nullptr) {
    if (!recorder_->Ended()) return Stop(*recorder_, now_us);
    const bool ran = *recorder_->Ended() < 2 && fs::exists(folder_ / "session.lcmlog");
    recorder_.reset();
    if (ran) return WriteReport(now_us);
  }
  if (reporter_ != nullptr && !reporter_->Ended()) {
    if (now_us - since_us_ > report_us_ + session_us_) reporter_->Signal(SIGKILL);
    return;
  }
  if (reporter_ != nullptr) {
    // Status 1: messages were lost, or a measure exceeds its limit. The page shows which.
    if (*reporter_->Ended() < 2) {
      ReadReport();
    } else if (problem_.empty()) {
      Fail("torquer-report", *reporter_);
    }
  }
  phase_ = Phase::kEnded;
}

void CaseStation::ReadReport() {
  try {
    report_ =
        ReadInputFile((folder_ / "report.html").string(), "look into its folder", kMostReportBytes);
  } catch (const UserError& error) {
    if (problem_.empty()) problem_ = error.what();
  }
}

void CaseStation::Stop(ChildProgram& program, std::int64_t now_us) const {
  if (now_us - since_us_ > kEndUs) program.Signal(SIGKILL);
}

void CaseStation::WriteReport(std::int64_t now_us) {
  session_us_ = now_us - began_us_;
  since_us_ = now_us;
  std::vector<std::string> words = {(programs_.folder / "torquer-report").string(),
                                    (folder_ / "session.lcmlog").string(), "--page",
                                    (folder_ / "report.html").string()};
  if (examination_) words.emplace_back("--examination");
  if (!programs_.trainee.empty()) words.push_back("--trainee=" + programs_.trainee);
  if (!programs_.group.empty()) words.push_back("--group=" + programs_.group);
  try {
    reporter_ = std::make_unique<ChildProgram>(words, (folder_ / "report.log").string());
  } catch (const UserError& error) {
    if (problem_.empty()) problem_ = error.what();
  }
}

std::string CaseStation::Text() const {
  nlohmann::json list = nlohmann::json::array();
  for (const Case& one : cases_) {
    list.push_back({{"name", Printable(one.name)},
                    {"title", Printable(one.title)},
                    {"task", Printable(one.task)},
                    {"difficulty", one.difficulty},
                    {"xray", one.xray},
                    {"instruments", one.instruments},
                    {"picture", !one.picture.empty()}});
  }
  return nlohmann::json({{"kind", "cases"},
                         {"cases", std::move(list)},
                         {"phase", Name(phase_)},
                         {"chosen", runs_ == 0 ? -1 : static_cast<int>(chosen_)},
                         {"examination", runs_ > 0 && examination_},
                         {"run", runs_},
                         {"problem", Printable(problem_)},
                         {"report", report_.has_value()},
                         {"folder", Printable(runs_ == 0 ? "" : folder_.string())}})
      .dump();
}

}  // namespace torquer::viewer
