// Input files named by a user.
#pragma once

#include <cstddef>
#include <cstdint>
#include <string>

namespace torquer {

/// Maximum number of bytes that ReadInputFile reads into memory.
inline constexpr std::int64_t kMostInputBytes = std::int64_t{1} << 30;

/// An ordinary file, open for reading. A folder, pipe, device or socket is refused, because a pipe
/// could wait forever for a writer.
class InputFile {
 public:
  /// Throws UserError "PATH: cannot be read: REASON; REMEDY".
  InputFile(const std::string& path, const std::string& remedy);
  ~InputFile();
  InputFile(const InputFile&) = delete;
  InputFile& operator=(const InputFile&) = delete;

  const std::string& path() const { return path_; }
  std::int64_t bytes() const { return bytes_; }  ///< size when it was opened

  /// Reads `size` bytes from `offset` on. Returns the number of bytes read, which is smaller only
  /// at the end of the file. Throws UserError if the disk cannot be read.
  std::size_t ReadAt(std::int64_t offset, void* to, std::size_t size) const;

 private:
  [[noreturn]] void Refuse(const std::string& reason) const;

  std::string path_;
  std::string remedy_;
  std::int64_t bytes_ = 0;
  int fd_ = -1;
};

/// Contents of an InputFile. Throws UserError as that does, and if the file has more than
/// `most_bytes`.
std::string ReadInputFile(const std::string& path, const std::string& remedy,
                          std::int64_t most_bytes = kMostInputBytes);

}  // namespace torquer
