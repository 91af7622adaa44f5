// A log in several files: session.lcmlog, session.lcmlog.part002, and so on. Records are numbered
// through all of them, so that the parts one after the other are a log again.
#pragma once

#include <cstdint>
#include <memory>
#include <string>
#include <vector>

#include "host/support/input_file.h"

namespace torquer {

/// The name of part `number`, >= 1, of the log `path`.
std::string LogPartPath(const std::string& path, int number);

/// The parts of the log `path` after the first that are there, in order.
std::vector<std::string> LaterLogParts(const std::string& path);

/// The bytes of a log and of its parts, as if they were one file.
class LogInput {
 public:
  /// `path` is a log, which is read with all parts that follow, those that there are; or one of
  /// these parts, for it and those after it. A log whose first part was removed is read from the
  /// oldest one that is there. Throws UserError as InputFile does.
  LogInput(const std::string& path, std::string remedy);

  const std::string& path() const { return path_; }
  std::int64_t bytes() const { return bytes_; }  ///< when it was opened

  /// As InputFile::ReadAt().
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
  // One at a time: a day has more parts than a process may have files.
  mutable std::size_t open_ = 0;
  mutable std::unique_ptr<InputFile> file_;
};

}  // namespace torquer
