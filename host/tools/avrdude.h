// Runs avrdude, which writes boards with Caterina and speaks to ISP programmers.
#pragma once

#include <filesystem>
#include <functional>
#include <string>
#include <vector>

namespace torquer::tools {

struct AvrdudeOptions {
  std::string avrdude = "avrdude";  ///< program
  int timeout_s = 60;  ///< after which avrdude is killed: it waits for ever for a lost board
  /// Whether the user wants to stop.
  std::function<bool()> stop = [] { return false; };
};

/// A folder for files that avrdude reads and writes; removed with its contents in the end.
class WorkFolder {
 public:
  /// Throws UserError when it cannot be created.
  WorkFolder();
  ~WorkFolder();
  WorkFolder(const WorkFolder&) = delete;
  WorkFolder& operator=(const WorkFolder&) = delete;

  std::string Path(const std::string& name) const { return path_ / name; }

 private:
  std::filesystem::path path_;
};

enum class AvrdudeEnding { kDone, kFailed, kTooLong, kStopped };

/// Runs it with `arguments`, its output in the file `log`. It and its children are killed after the
/// time in `options`, or when the user stops. Throws UserError naming `needed_for` if it is not
/// installed.
AvrdudeEnding RunAvrdude(const std::vector<std::string>& arguments, const std::string& log,
                         const std::string& needed_for, const AvrdudeOptions& options);

/// The text in a file; "" if there is none.
std::string FileContents(const std::string& path);

}  // namespace torquer::tools
