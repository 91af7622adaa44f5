// A program that writes files, run in a separate folder; and whether its files are as they were
// or whole.
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

/// A program, and the files that it writes into the folder that @ stands for in its words.
struct Writer {
  std::string name;
  Words words;
  Words former = {};        ///< files that are there already, with other contents
  std::size_t outputs = 1;  ///< how many files it writes, at least
  /// It does without these files: then its status is 0, and it says what is wrong.
  bool does_without = false;
  /// It goes on until it is asked to end; it writes at once.
  bool stays = false;
  /// Whether a file is whole, where one run does not write the same as the next.
  std::function<bool(const std::string& text)> whole = {};
  /// The same where it was asked to end before it had all, if it then keeps what it has.
  std::function<bool(const std::string& text)> whole_so_far = {};
};

/// Every program that writes files, and each kind of file that it writes.
const std::vector<Writer>& Writers();

/// How a run ended, and what it said on standard error.
struct WriterRun {
  int status = -1;
  std::string said;
};

/// A folder with the files that were there before a writer.
class WriterBench {
 public:
  explicit WriterBench(const Writer& writer);

  WriterRun With(const Fault& fault) const;
  /// The program's words, with this folder in them.
  Words Command() const;

  /// All files in the folder, with their contents.
  FilesByName Files() const;

  const TemporaryFolder& folder() const { return folder_; }

 private:
  const Writer& writer_;
  TemporaryFolder folder_;
};

/// Checks that each file is what was there before or whole. `reference`: what an undisturbed run
/// left; `may_leave`: files that are not finished too; `run`: how it ended.
void CheckFiles(const Writer& writer, const FilesByName& files, const FilesByName& reference,
                bool may_leave, const WriterRun& run);

/// Whether all of `reference` is there and whole.
bool AllWhole(const Writer& writer, const FilesByName& files, const FilesByName& reference);

}  // namespace torquer::test
