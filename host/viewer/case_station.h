// The cases that a trainee chooses from, and the one that runs: simulator and recorder as other
// programs, and at its end the report.
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
  bool assessed = false;  ///< there is a record of what the trainee has done
  std::vector<std::string> instruments;
  std::string picture;  ///< JPEG; "" where there is none
};

/// The cases of a folder: of each scene that has a section [case], the easiest first; each with its
/// picture from `pictures/NAME.jpg` in that folder. `problems` takes what is wrong with files that
/// are left out. Throws UserError where there is no case at all.
std::vector<Case> ReadCases(const std::filesystem::path& folder,
                            std::vector<std::string>& problems);

/// Runs one case at a time. No clock: the caller says what time it is, ascending.
class CaseStation {
 public:
  enum class Phase { kChoose, kStarting, kRunning, kEnding, kEnded };

  struct Programs {
    std::filesystem::path folder;  ///< of torquer-simulator, -recorder and -report
    std::string lcm_url;           ///< for them; "" for their default
    /// Room on the disk of the sessions, bytes; none: as the file system says.
    std::function<std::int64_t()> free_bytes = {};
  };

  /// A minute of a scene that moves takes 0.1 GB. With less room no case starts, and a running case
  /// ends, so that a page that stays open does not fill the disk.
  static constexpr std::int64_t kLeastFreeBytes = 2'000'000'000;

  /// Each session has its folder in `sessions`/CASE, named by the time. Throws UserError if that
  /// cannot be created.
  CaseStation(std::vector<Case> cases, std::filesystem::path sessions, Programs programs);
  /// Ends what runs, in order: simulator, recorder, and the report is written.
  ~CaseStation();
  CaseStation(const CaseStation&) = delete;
  CaseStation& operator=(const CaseStation&) = delete;

  /// False, and nothing is done, where the phase is another one than the picture above says, there
  /// is no such case, or an examination is wanted of a case without X-ray. Every start has its own
  /// folder with log, record and report; they say that the session is an examination.
  bool Start(std::size_t number, std::int64_t now_us, bool examination = false);
  bool End(std::int64_t now_us);
  bool Close();

  /// A simulator has published a state: that of the case, or where none runs a stranger's, beside
  /// which no case starts.
  void SawState(std::int64_t now_us);
  /// Looks after the programs; call it often. Whether anything has changed that Text() says.
  bool Advance(std::int64_t now_us);

  Phase phase() const { return phase_; }
  /// The case that was chosen last; null before any choice.
  const Case* chosen() const;
  /// Number of starts of cases.
  int runs() const { return runs_; }
  /// The page that torquer-report wrote; null if there is none.
  const std::string* report() const { return report_ ? &*report_ : nullptr; }
  const std::vector<Case>& cases() const { return cases_; }

  /// For the page: cases, phase, and what went wrong (README.md).
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
  std::int64_t since_us_ = 0;   // when the phase, or what is waited for in it, began
  // Time that torquer-report may take in addition to the length of the session, which it repeats.
  std::int64_t report_us_ = 120'000'000;
  std::int64_t session_us_ = 0;
  std::optional<std::int64_t> stranger_us_;  // newest state that is of no case
  std::string problem_;
  std::optional<std::string> report_;
  bool changed_ = true;
};

}  // namespace torquer::viewer
