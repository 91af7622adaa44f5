// Reads logs of LCM messages, written by event_log_writer or lcm-logger. Skips damage and reports
// it.
//
// A record: the word 0xEDA1DA01, its number (8 bytes), its time (8). The lengths of channel and
// data (4 each), channel and data follow. All numbers are in network byte order. Records follow
// each other without a gap, and their numbers rise by one.
#pragma once

#include <cstdint>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "host/support/log_parts.h"

namespace torquer {

/// One record; its views are valid until the next record is read.
struct LogRecord {
  std::int64_t number = 0;
  std::int64_t time_us = 0;  ///< wall clock of the logger at reception
  std::string_view channel;
  std::span<const std::uint8_t> data;
  std::int64_t data_at = 0;  ///< position of `data` in the file
};

/// Time from a log's first record to another, us. Limited to 0 to a year, because recorded times
/// are not trusted.
std::int64_t ElapsedUs(std::int64_t first_us, std::int64_t time_us);

/// Damage: the parts of a log that could not be read.
struct LogDamage {
  std::int64_t places = 0;   ///< stretches without records, and records with a wrong number
  std::int64_t bytes = 0;    ///< in these stretches
  std::int64_t missing = 0;  ///< lost records, by the numbers of their neighbors
  bool cut = false;          ///< the log ends within a record

  bool any() const { return places > 0 || missing > 0 || cut; }
  /// A sentence, such as "2 damaged places (91 bytes), 3 records missing"; "" without damage.
  std::string Describe() const;
};

/// Reads a log record by record, with limited memory. Logs that were joined are not damage: the
/// numbers begin again. It reaches the end for any bytes. A record is
/// valid if its header is plausible and another record or the end of the file follows it. Bytes
/// between valid records are counted and skipped.
class EventLogReader {
 public:
  /// Reads a log and its parts, as LogInput does. Throws UserError naming the file when it cannot
  /// be read.
  explicit EventLogReader(const std::string& path);

  /// Reads the next whole record; false at the end of the log.
  bool Next(LogRecord& record);

  /// Number of logs that are joined in the file, up to the newest record.
  std::int64_t logs() const { return logs_; }
  /// Throws UserError with the file and the number of its logs if there are several. Call it after
  /// Next() returned false.
  void RequireOneLog() const;

  /// Damage so far; complete after Next() returned false.
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
  bool BeginsLog(const Header& header) const;

  LogInput file_;
  std::vector<std::uint8_t> window_;  // part of the file from window_at_ on
  std::int64_t window_at_ = 0;
  std::int64_t at_ = 0;
  std::int64_t expected_ = -1;  // number of the next record
  std::int64_t logs_ = 1;
  LogDamage damage_;
};

/// Throws UserError if the log at `path` cannot be read, or if several logs are joined in it.
void RequireOneLog(const std::string& path);

}  // namespace torquer
