// Rotating log of a recorder: a log in parts. Older parts may be removed, and part of the disk
// stays free.
#pragma once

#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <string_view>

#include "host/support/event_log_writer.h"

namespace torquer {

class RotatingLog {
 public:
  /// Bytes that stay free for other programs. This exceeds the recorder's buffers, so buffered
  /// messages can still be written and the log ends intact.
  static constexpr std::int64_t kLeastFreeBytes = 100'000'000;

  /// Creates the file `path`. A part that reaches `part_bytes` is followed by another
  /// (host/support/log_parts.h); 0: one part. Only the newest `keep` parts with records stay; 0:
  /// all. Throws UserError if the log or a part of it already exists, or if the file cannot be
  /// created. It also throws if the disk has less than kLeastFreeBytes free.
  RotatingLog(const std::string& path, std::int64_t part_bytes, int keep);

  /// See EventLogWriter.
  void Write(std::int64_t time_us, std::string_view channel, std::span<const std::uint8_t> data);
  void Flush();
  void Finish();

  /// Removes old parts once the newest one has records. Starts the next part if this one has
  /// reached `part_bytes`, and then returns true. Throws UserError if an old part cannot be removed
  /// or the new part cannot be created.
  bool Rotate();

  /// Free bytes on the disk.
  std::int64_t FreeBytes() const;

  std::int64_t records() const { return part_->next(); }
  std::int64_t bytes() const { return earlier_bytes_ + part_->bytes(); }  ///< of all parts
  int parts() const { return number_; }
  int removed() const { return removed_; }  ///< number of removed parts

 private:
  void RemoveOldest();

  std::string path_;
  std::int64_t part_bytes_;
  int keep_;
  int number_ = 1;
  int removed_ = 0;
  std::int64_t earlier_bytes_ = 0;
  std::optional<EventLogWriter> part_;
};

}  // namespace torquer
