// Files that are there complete, or not at all.
#pragma once

#include <cstdint>
#include <memory>
#include <ostream>
#include <string>
#include <string_view>

namespace torquer {

/// A file that is written beside its final name and takes that name with Finish(). Whatever goes
/// wrong before, a power cut or a signal included, the name stands for what it stood for; a file
/// that is not finished leaves nothing behind (where the file system has no files without a name, a
/// killed process leaves `.torquer-PID-N.tmp`).
///
/// Only ordinary files are replaced. Where the path is a symbolic link, the file behind the link is
/// replaced and the link stays. A replaced file keeps its permissions.
class AtomicFile {
 public:
  /// Throws UserError naming `path`, the reason and the remedy when no file can be written there:
  /// it is a folder, device, pipe or socket, it is write-protected, its folder is missing or may
  /// not be written to, its name is too long, or its symbolic links form a loop.
  explicit AtomicFile(const std::string& path);
  ~AtomicFile();
  AtomicFile(const AtomicFile&) = delete;
  AtomicFile& operator=(const AtomicFile&) = delete;

  /// Where the contents go. It fails silently, as streams do; Finish() reports it.
  std::ostream& out() { return out_; }

  /// The file, still empty, for a program that writes it in place of out().
  int descriptor() const;

  /// Sets room on the disk aside, so that a file of up to `bytes` cannot fail for want of it later.
  /// Throws UserError when there is not as much.
  void Reserve(std::int64_t bytes);

  /// Marks the contents so far as useful by themselves. If the disk fails later, Finish() keeps the
  /// contents up to the last call whose data is completely written. Returns false once writing has
  /// failed.
  bool KeepSoFar();

  /// Writes what is still in memory, syncs the file to the disk, renames it to its final name and
  /// syncs the folder. Call it once. Throws UserError naming the path and the reason when not all
  /// of this could be done. Then the name stands for what it stood for; what KeepSoFar() said to
  /// keep lies beside it in PATH.partial, and the message says so.
  void Finish();

 private:
  class Buffer;

  std::string NameIt(const std::string& name);
  std::string SavePartial();

  std::string path_;       // as given, for messages
  std::string target_;     // `path_` with its symbolic links followed
  std::string temporary_;  // beside the target; empty where the file has no name yet
  std::unique_ptr<Buffer> buffer_;
  std::ostream out_;
};

/// Writes `contents` to an AtomicFile at `path`. Throws UserError as that does.
void WriteFileAtomically(const std::string& path, std::string_view contents);

}  // namespace torquer
