// A log in several files: session.lcmlog, session.lcmlog.part002, and so on. Records are numbered
// through all of them, so that the concatenated parts form a log.
#pragma once

#include <cstdint>
#include <memory>
#include <string>
#include <vector>

#include "host/support/input_file.h"

namespace torquer {

/// Path of part `number`, >= 1, of the log `path`.
std::string LogPartPath(const std::string& path, int number);

/// Existing parts of the log `path` after the first, in order.
std::vector<std::string> LaterLogParts(const std::string& path);

/// Bytes of a log and its parts, as if they were one file.
class LogInput {
 public:
  /// `path`: a log, or a part of a log. The existing parts after it are read, too. A log whose
  /// first part was removed starts with the oldest existing part. Throws UserError as InputFile
  /// does.
  LogInput(const std::string& path, std::string remedy);

  const std::string& path() const { return path_; }
  std::int64_t bytes() const { return bytes_; }  ///< size when it was opened

  /// Same as InputFile::ReadAt().
  std::size_t ReadAt(std::int64_t offset, void* to, std::size_t size) const;

 private:
  struct Part {
    std::string path;
    std::int64_t begin = 0;
    std::int64_t bytes = 0;
  };
  const InputFile& Open(std::size_t part) const;

  std::string path_;
  std::string remedy_;
  std::vector<Part> parts_;
  std::int64_t bytes_ = 0;
  // Only one part is open, because a day has more parts than a process may have open files.
  mutable std::size_t open_ = 0;
  mutable std::unique_ptr<InputFile> file_;
};

}  // namespace torquer
