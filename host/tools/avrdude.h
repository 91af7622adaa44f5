// Runner of avrdude, which writes boards with Caterina and controls ISP programmers.
#pragma once

#include <filesystem>
#include <functional>
#include <string>
#include <vector>

namespace torquer::tools {

struct AvrdudeOptions {
  std::string avrdude = "avrdude";  ///< program
  int timeout_s = 60;  ///< timeout after which avrdude is killed: it waits forever for a lost board
  /// Returns true if the user wants to stop.
  std::function<bool()> stop = [] { return false; };
};

/// Temporary folder for files that avrdude reads and writes; the destructor removes it with its
/// contents.
class WorkFolder {
 public:
  /// Throws UserError if the folder cannot be created.
  WorkFolder();
  ~WorkFolder();
  WorkFolder(const WorkFolder&) = delete;
  WorkFolder& operator=(const WorkFolder&) = delete;

  std::string Path(const std::string& name) const { return path_ / name; }

 private:
  std::filesystem::path path_;
};

enum class AvrdudeEnding { kDone, kFailed, kTooLong, kStopped };

/// Runs avrdude with `arguments` and writes its output to the file `log`. It and its children are
/// killed after the timeout in `options`, or if the user stops. Throws UserError with `needed_for`
/// if avrdude is not installed.
AvrdudeEnding RunAvrdude(const std::vector<std::string>& arguments, const std::string& log,
                         const std::string& needed_for, const AvrdudeOptions& options);

/// Contents of a text file; "" if it cannot be read.
std::string FileContents(const std::string& path);

}  // namespace torquer::tools
