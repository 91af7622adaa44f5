// Writes logs of LCM messages, in the format of lcm-logger.
#pragma once

#include <cstdint>
#include <span>
#include <string>
#include <string_view>
#include <vector>

namespace torquer {

class EventLogWriter {
 public:
  /// Creates the file `path`; its first record gets the number `first`. Throws UserError if the
  /// file exists or cannot be created.
  explicit EventLogWriter(std::string path, std::int64_t first = 0);
  /// Closes the file; unflushed records are lost.
  ~EventLogWriter();
  EventLogWriter(const EventLogWriter&) = delete;
  EventLogWriter& operator=(const EventLogWriter&) = delete;

  /// Appends a record, which is written to the file later. `time_us`: since 1970. Throws UserError
  /// with the kept part if the disk fails: the file then ends with its last whole record.
  void Write(std::int64_t time_us, std::string_view channel, std::span<const std::uint8_t> data);

  /// Hands all records to the kernel. Throws as Write() does.
  void Flush();
  /// Calls Flush(), and waits until the data is on the disk.
  void Finish();

  std::int64_t next() const { return next_; }  ///< number of the next record
  std::int64_t bytes() const { return kept_bytes_ + static_cast<std::int64_t>(waiting_.size()); }

 private:
  [[noreturn]] void Fail(int reason);

  std::string path_;
  int file_ = -1;
  std::vector<std::uint8_t> waiting_;  // whole records
  std::int64_t kept_bytes_ = 0;        // in whole records in the file
  std::int64_t kept_ = 0;              // records in the file
  std::int64_t next_ = 0;
};

}  // namespace torquer
