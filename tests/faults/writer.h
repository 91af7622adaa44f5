// Runs a program that writes files in a separate folder, and checks that its files are unchanged or
// complete.
#pragma once

#include <functional>
#include <map>
#include <string>
#include <vector>

#include "tests/faults/faulty_run.h"
#include "tests/support/temporary_folder.h"

namespace torquer::test {

using Words = std::vector<std::string>;
using FilesByName = std::map<std::string, std::string>;

/// A program and its output files; @ in its arguments stands for the output folder.
struct Writer {
  std::string name;
  Words words;
  Words former = {};        ///< files that exist before, with other contents
  std::size_t outputs = 1;  ///< minimum number of files that it writes
  /// True if it can run without these files: its status is then 0, and it reports the failure.
  bool does_without = false;
  /// True if it refuses to replace an existing output: its status is then 2.
  bool refuses_existing = false;
  /// True if it runs until a signal; it writes its files at once.
  bool stays = false;
  /// Text that it prints when it is ready; "" if there is none.
  std::string ready = {};
  /// True if a file is complete; needed when two runs write different data.
  std::function<bool(const std::string& text)> whole = {};
  /// Same for a run that was ended early and keeps its data so far.
  std::function<bool(const std::string& text)> whole_so_far = {};
};

/// Every program that writes files, and each kind of file that it writes.
const std::vector<Writer>& Writers();

/// Exit status and standard error of a run.
struct WriterRun {
  int status = -1;
  std::string said;
};

/// Folder with the files that existed before the writer ran.
class WriterBench {
 public:
  explicit WriterBench(const Writer& writer);

  WriterRun With(const Fault& fault) const;
  /// Command of the program, with this folder inserted.
  Words Command() const;

  /// All files in the folder, with their contents.
  FilesByName Files() const;

  const TemporaryFolder& folder() const { return folder_; }

 private:
  std::size_t WrittenFiles() const;
  void EndOnceReady(ChildProcess& process) const;

  const Writer& writer_;
  TemporaryFolder folder_;
};

/// Checks that each file is unchanged or complete. `reference` has the files of an undisturbed run.
/// `may_leave` also allows unfinished files. `run` is the result.
void CheckFiles(const Writer& writer, const FilesByName& files, const FilesByName& reference,
                bool may_leave, const WriterRun& run);

/// True if all files of `reference` exist and are complete.
bool AllWhole(const Writer& writer, const FilesByName& files, const FilesByName& reference);

}  // namespace torquer::test
