// A file that is there complete, or not at all.
#pragma once

#include <fstream>
#include <string>

namespace torquer::simulator {

/// Written beside its name first; takes it with Finish(). What is not finished leaves nothing.
class WholeFile {
 public:
  /// Throws UserError naming `path` when nothing can be written there.
  explicit WholeFile(const std::string& path);
  ~WholeFile();
  WholeFile(const WholeFile&) = delete;
  WholeFile& operator=(const WholeFile&) = delete;

  std::ostream& out() { return out_; }
  /// Throws UserError when not all of it could be written.
  void Finish();

 private:
  const std::string path_;
  const std::string unfinished_;
  std::ofstream out_;
};

}  // namespace torquer::simulator
