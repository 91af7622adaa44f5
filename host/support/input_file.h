// Files that a user gives to be read.
#pragma once

#include <cstddef>
#include <cstdint>
#include <string>

namespace torquer {

/// Most bytes that ReadInputFile takes into memory.
inline constexpr std::int64_t kMostInputBytes = std::int64_t{1} << 30;

/// An ordinary file, open for reading. A folder, pipe, device or socket in its place is refused, so
/// that nobody waits for a writer that never comes.
class InputFile {
 public:
  /// Throws UserError "PATH: cannot be read: REASON; REMEDY".
  InputFile(const std::string& path, const std::string& remedy);
  ~InputFile();
  InputFile(const InputFile&) = delete;
  InputFile& operator=(const InputFile&) = delete;

  const std::string& path() const { return path_; }
  std::int64_t bytes() const { return bytes_; }  ///< when it was opened

  /// Reads `size` bytes from `offset` on. Returns how many there were: fewer only at the end of the
  /// file. Throws UserError when the disk cannot be read.
  std::size_t ReadAt(std::int64_t offset, void* to, std::size_t size) const;

 private:
  [[noreturn]] void Refuse(const std::string& reason) const;

  std::string path_;
  std::string remedy_;
  std::int64_t bytes_ = 0;
  int fd_ = -1;
};

/// The contents of an InputFile. Throws UserError as that does, and where the file has more than
/// `most_bytes`.
std::string ReadInputFile(const std::string& path, const std::string& remedy,
                          std::int64_t most_bytes = kMostInputBytes);

}  // namespace torquer
