// The log of a recorder: in parts, of which it may keep the newest, on a disk that it does not
// fill.
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
  /// That stay free for other programs: more than the recorder may have in memory, so that what it
  /// has is written and the log ends whole.
  static constexpr std::int64_t kLeastFreeBytes = 100'000'000;

  /// Makes the file `path`. A part that has `part_bytes` is followed by another (host/support/
  /// log_parts.h), and of all parts the newest `keep` stay; 0: one part, all parts. Throws
  /// UserError when the log or a part of it is there already, the file cannot be made, or its disk
  /// is full but for kLeastFreeBytes.
  RotatingLog(const std::string& path, std::int64_t part_bytes, int keep);

  /// As EventLogWriter has them.
  void Write(std::int64_t time_us, std::string_view channel, std::span<const std::uint8_t> data);
  void Flush();
  void Finish();

  /// Goes on to the next part where this one is long enough; whether it did. Throws UserError where
  /// that cannot be.
  bool Rotate();

  /// Bytes that are free on the disk.
  std::int64_t FreeBytes() const;

  std::int64_t records() const { return part_->next(); }
  std::int64_t bytes() const { return earlier_bytes_ + part_->bytes(); }  ///< of all parts
  int parts() const { return number_; }
  int removed() const { return removed_; }  ///< of the parts

 private:
  std::string path_;
  std::int64_t part_bytes_;
  int keep_;
  int number_ = 1;
  int removed_ = 0;
  std::int64_t earlier_bytes_ = 0;
  std::optional<EventLogWriter> part_;
};

}  // namespace torquer
