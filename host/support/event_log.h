// Logs of LCM messages, as event_log_writer and lcm-logger write them: read past damage, and with
// an account of it.
//
// A record: the word 0xEDA1DA01, its number (8 bytes), its time (8), the lengths of channel and
// data (4 each), channel, data; all numbers in network byte order. Records follow each other
// without a gap, and their numbers rise by one.
#pragma once

#include <cstdint>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "host/support/log_parts.h"

namespace torquer {

/// One record; views are valid until the next is read.
struct LogRecord {
  std::int64_t number = 0;
  std::int64_t time_us = 0;  ///< when the logger received it, its wall clock
  std::string_view channel;
  std::span<const std::uint8_t> data;
  std::int64_t data_at = 0;  ///< the place of `data` in the file
};

/// From the time of a log's first record to that of another, us: 0 to a year, since times that were
/// recorded may be anything.
std::int64_t ElapsedUs(std::int64_t first_us, std::int64_t time_us);

/// Damage: the parts of a log that could not be read.
struct LogDamage {
  std::int64_t places = 0;   ///< stretches that are no records, and records with a wrong number
  std::int64_t bytes = 0;    ///< in these stretches
  std::int64_t missing = 0;  ///< records that were there, by the numbers of those beside them
  bool cut = false;          ///< the log ends within a record

  bool any() const { return places > 0 || missing > 0 || cut; }
  /// A sentence, such as "2 damaged places (91 bytes), 3 records missing"; "" without damage.
  std::string Describe() const;
};

/// Reads a log record by record, in memory that does not grow with it. Whatever the bytes are, it
/// comes to the end: a record counts where its header is plausible and where another record or the
/// end of the file follows it, and what lies between such records is counted and skipped.
class EventLogReader {
 public:
  /// Reads a log and its parts, as LogInput does. Throws UserError naming the file when it cannot
  /// be read.
  explicit EventLogReader(const std::string& path);

  /// Reads the next whole record; false at the end of the log.
  bool Next(LogRecord& record);

  /// So far; complete after Next() returned false.
  const LogDamage& damage() const { return damage_; }

 private:
  enum class Kind { kNone, kCut, kRecord };
  struct Header {
    std::int64_t number = 0;
    std::int64_t time_us = 0;
    std::int64_t channel_bytes = 0;
    std::int64_t data_bytes = 0;
    std::int64_t end = 0;  // in the file
  };

  const std::uint8_t* At(std::int64_t offset, std::size_t size);
  Kind Look(std::int64_t offset, Header& header) const;
  bool RecordFollows(std::int64_t offset) const;
  std::int64_t FindRecord(std::int64_t from, std::int64_t limit);
  bool Place(Header& header);
  bool NumberFits(const Header& header);

  LogInput file_;
  std::vector<std::uint8_t> window_;  // of the file, from window_at_ on
  std::int64_t window_at_ = 0;
  std::int64_t at_ = 0;
  std::int64_t expected_ = -1;  // the next number
  LogDamage damage_;
};

}  // namespace torquer
