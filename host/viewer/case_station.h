// Case station: lists the cases for a trainee and runs one of them. It starts simulator and
// recorder as programs, and writes the report at the end.
//
//   choose --Start--> starting --first state--> running --End--> ending --> ended --Close--> choose
#pragma once

#include <cstdint>
#include <filesystem>
#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "host/support/child_program.h"

namespace torquer::viewer {

/// A scene with a section [case].
struct Case {
  std::string name;  ///< of its file, without the ending
  std::string file;
  std::string title;
  std::string task;
  int difficulty = 1;
  bool xray = false;
  bool assessed = false;  ///< the scene has [effects.assessment]
  std::vector<std::string> instruments;
  std::string picture;  ///< JPEG; "" where there is none
};

/// Cases of a folder: its scenes with a section [case], the easiest first, with the pictures
/// `pictures/NAME.jpg` of that folder. `problems` gets a message for each file that is left out.
/// Throws UserError if the folder has no case.
std::vector<Case> ReadCases(const std::filesystem::path& folder,
                            std::vector<std::string>& problems);

/// Runs one case at a time. It has no clock: the caller passes the time, which must not decrease.
class CaseStation {
 public:
  enum class Phase { kChoose, kStarting, kRunning, kEnding, kEnded };

  struct Programs {
    std::filesystem::path folder;  ///< of torquer-simulator, -recorder and -report
    std::string lcm_url;           ///< for them; "" for their default
    std::string trainee = {};      ///< in every report; "": not named
    std::string group = {};        ///< of the trainee; "": none
    /// Free bytes on the disk of the sessions; empty: from the file system.
    std::function<std::int64_t()> free_bytes = {};
  };

  /// Smallest free space. With less, no case starts and a running case ends, so that an open page
  /// does not fill the disk. A minute of a moving scene takes 0.1 GB.
  static constexpr std::int64_t kLeastFreeBytes = 2'000'000'000;

  /// Each session has a folder in `sessions`/CASE, named by the time. Throws UserError if it cannot
  /// be created.
  CaseStation(std::vector<Case> cases, std::filesystem::path sessions, Programs programs);
  /// Ends the running programs in order: simulator, recorder. Then it writes the report.
  ~CaseStation();
  CaseStation(const CaseStation&) = delete;
  CaseStation& operator=(const CaseStation&) = delete;

  /// Each returns false without effect in the wrong phase (picture above), for an unknown case, or
  /// for examinations without X-ray. Every start has a folder with log, record and report, which
  /// mark an examination.
  bool Start(std::size_t number, std::int64_t now_us, bool examination = false);
  bool End(std::int64_t now_us);
  bool Close();

  /// Reports that a simulator has published a state. Without a running case it is a foreign
  /// simulator, beside which no case starts.
  void SawState(std::int64_t now_us);
  /// Checks the programs; call it often. True if the text of Text() has changed.
  bool Advance(std::int64_t now_us);

  Phase phase() const { return phase_; }
  /// The last chosen case; null before a choice.
  const Case* chosen() const;
  /// Number of starts of cases.
  int runs() const { return runs_; }
  /// The page that torquer-report wrote; null if there is none.
  const std::string* report() const { return report_ ? &*report_ : nullptr; }
  const std::vector<Case>& cases() const { return cases_; }

  /// Text for the page: cases, phase and problems (README.md).
  std::string Text() const;

 private:
  bool HasRoom();
  void Begin(std::int64_t now_us);
  void AdvanceRecorder(std::int64_t now_us);
  void AdvanceSimulator(std::int64_t now_us);
  void AdvanceEnding(std::int64_t now_us);
  void Stop(ChildProgram& program, std::int64_t now_us) const;
  void WriteReport(std::int64_t now_us);
  void ReadReport();
  void Fail(const std::string& program, ChildProgram& ended);

  std::vector<Case> cases_;
  std::filesystem::path sessions_;
  Programs programs_;
  Phase phase_ = Phase::kChoose;
  std::size_t chosen_ = 0;
  bool examination_ = false;  // of the case that was chosen last
  int runs_ = 0;
  std::filesystem::path folder_;  // of the session
  std::unique_ptr<ChildProgram> recorder_;
  std::unique_ptr<ChildProgram> simulator_;
  std::unique_ptr<ChildProgram> reporter_;
  std::int64_t looked_us_ = 0;  // for room on the disk
  std::int64_t began_us_ = 0;   // when the case was started
  std::int64_t since_us_ = 0;   // start of the phase, or of the wait in it
  // Time that torquer-report may take in addition to the length of the session, which it repeats.
  std::int64_t report_us_ = 120'000'000;
  std::int64_t session_us_ = 0;
  std::optional<std::int64_t> stranger_us_;  // newest state of a foreign simulator
  std::string problem_;
  std::optional<std::string> report_;
  bool changed_ = true;
};

}  // namespace torquer::viewer
