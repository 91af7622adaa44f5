// Files that appear complete, or not at all.
#pragma once

#include <cstdint>
#include <memory>
#include <ostream>
#include <string>
#include <string_view>

namespace torquer {

/// A file that is written beside its final name and takes that name with Finish(). Until then the
/// old file under that name stays unchanged, even after a power cut or a signal. An unfinished file
/// is removed. Only on a file system without unnamed files a killed process leaves
/// `.torquer-PID-N.tmp`.
///
/// Only ordinary files are replaced. If the path is a symbolic link, its target is replaced and the
/// link stays. A replaced file keeps its permissions.
class AtomicFile {
 public:
  /// Throws UserError naming `path`, the reason and the remedy if no file can be written there. The
  /// path may be a folder, device, pipe or socket, write-protected, or too long. Its folder may be
  /// missing or not writable, and its symbolic links may form a loop.
  explicit AtomicFile(const std::string& path);
  ~AtomicFile();
  AtomicFile(const AtomicFile&) = delete;
  AtomicFile& operator=(const AtomicFile&) = delete;

  /// Stream for the contents. It fails silently, as streams do; Finish() reports it.
  std::ostream& out() { return out_; }

  /// Descriptor of the empty file, for a program that writes it in place of out().
  int descriptor() const;

  /// Reserves disk space, so that a file of up to `bytes` cannot fail later because the disk is
  /// full. Throws UserError if there is not enough space.
  void Reserve(std::int64_t bytes);

  /// Marks the contents so far as useful by themselves. If the disk fails later, Finish() keeps the
  /// contents up to the last call whose data is completely written. Returns false once writing has
  /// failed.
  bool KeepSoFar();

  /// Writes the buffered data, syncs the file to the disk, renames it to its final name and syncs
  /// the folder. Call it once. Throws UserError naming the path and the reason if a step fails.
  /// Then the old file stays; the data kept by KeepSoFar() is in PATH.partial, and the message says
  /// so.
  void Finish();

 private:
  class Buffer;

  std::string NameIt(const std::string& name);
  std::string SavePartial();

  std::string path_;       // as given, for messages
  std::string target_;     // `path_` with its symbolic links followed
  std::string temporary_;  // beside the target; empty while the file has no name
  std::unique_ptr<Buffer> buffer_;
  std::ostream out_;
};

/// Writes `contents` to an AtomicFile at `path`. Throws UserError as that does.
void WriteFileAtomically(const std::string& path, std::string_view contents);

}  // namespace torquer
