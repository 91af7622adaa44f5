#include "host/simulator/whole_file.h"

#include <filesystem>

#include "host/support/error.h"

namespace torquer::simulator {

WholeFile::WholeFile(const std::string& path) : path_(path), unfinished_(path + ".part") {
  if (!std::filesystem::is_directory(path_)) out_.open(unfinished_);
  if (!out_.is_open()) {
    throw UserError(path_ + ": cannot be written; name a file in a folder that is there and yours");
  }
}

WholeFile::~WholeFile() {
  if (!out_.is_open()) return;
  out_.close();
  std::error_code ignored;
  std::filesystem::remove(unfinished_, ignored);
}

void WholeFile::Finish() {
  out_.close();
  std::error_code error;
  if (out_) std::filesystem::rename(unfinished_, path_, error);
  if (out_ && !error) return;
  std::error_code ignored;
  std::filesystem::remove(unfinished_, ignored);
  throw UserError(path_ + ": writing failed" + (error ? " (" + error.message() + ")" : "") +
                  "; is the disk full?");
}

}  // namespace torquer::simulator
