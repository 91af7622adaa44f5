#include "host/support/event_log.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>

#include "host/support/error.h"

namespace torquer {
namespace {

constexpr std::array<std::uint8_t, 4> kSync = {0xed, 0xa1, 0xda, 0x01};
constexpr std::size_t kHeaderBytes = 28;
constexpr std::int64_t kMostChannelBytes = 63;       // LCM's own limit
constexpr std::int64_t kMostDataBytes = 64LL << 20;  // a thousand times our largest message
constexpr std::int64_t kMostNumber = 1LL << 40;      // years at a million records a second
constexpr std::size_t kWindowBytes = 1U << 16;

std::int64_t BigEndian(const std::uint8_t* bytes, int size) {
  std::uint64_t value = 0;
  for (int i = 0; i < size; ++i) value = value << 8 | bytes[i];
  return static_cast<std::int64_t>(value);
}

std::string Counted(std::int64_t count, const std::string& what) {
  return fmt::format("{} {}{}", count, what, count == 1 ? "" : "s");
}

}  // namespace

std::int64_t ElapsedUs(std::int64_t first_us, std::int64_t time_us) {
  constexpr std::int64_t kYearUs = 365LL * 24 * 3600 * 1'000'000;
  if (time_us <= first_us) return 0;
  // The unsigned difference cannot overflow.
  const std::uint64_t elapsed_us =
      static_cast<std::uint64_t>(time_us) - static_cast<std::uint64_t>(first_us);
  return elapsed_us < kYearUs ? static_cast<std::int64_t>(elapsed_us) : kYearUs;
}

std::string LogDamage::Describe() const {
  std::string text;
  const auto add = [&text](const std::string& more) { text += (text.empty() ? "" : ", ") + more; };
  if (places > 0) {
    add(fmt::format("{} ({})", Counted(places, "damaged place"), Counted(bytes, "byte")));
  }
  if (missing > 0) add(Counted(missing, "record") + " missing");
  if (cut) add("cut off within its last record");
  return text;
}

EventLogReader::EventLogReader(const std::string& path)
    : file_(path, "give a log that torquer-recorder wrote") {}

// `size` bytes from `offset` on; null if the file has fewer.
const std::uint8_t* EventLogReader::At(std::int64_t offset, std::size_t size) {
  if (offset < window_at_ || offset + static_cast<std::int64_t>(size) >
                                 window_at_ + static_cast<std::int64_t>(window_.size())) {
    if (offset + static_cast<std::int64_t>(size) > file_.bytes()) return nullptr;
    window_.resize(std::max(size, kWindowBytes));
    window_at_ = offset;
    window_.resize(file_.ReadAt(offset, window_.data(), window_.size()));
    if (window_.size() < size) return nullptr;  // the file has become shorter since it was opened
  }
  return window_.data() + (offset - window_at_);
}

EventLogReader::Kind EventLogReader::Look(std::int64_t offset, Header& header) const {
  // Reads without the window, because a hostile log can name places all over the file.
  std::array<std::uint8_t, kHeaderBytes + kMostChannelBytes> head;
  const std::size_t got = file_.ReadAt(offset, head.data(), head.size());
  const std::uint8_t* const bytes = head.data();
  if (!std::equal(bytes, bytes + std::min(got, kSync.size()), kSync.begin())) return Kind::kNone;
  if (got < kHeaderBytes) return Kind::kCut;
  header.number = BigEndian(bytes + 4, 8);
  header.time_us = BigEndian(bytes + 12, 8);
  header.channel_bytes = BigEndian(bytes + 20, 4);
  header.data_bytes = BigEndian(bytes + 24, 4);
  if (header.number < 0 || header.number > kMostNumber || header.channel_bytes < 1 ||
      header.channel_bytes > kMostChannelBytes || header.data_bytes > kMostDataBytes) {
    return Kind::kNone;
  }
  header.end =
      offset + static_cast<std::int64_t>(kHeaderBytes) + header.channel_bytes + header.data_bytes;
  const auto channel_bytes = static_cast<std::size_t>(header.channel_bytes);
  if (got < kHeaderBytes + channel_bytes) return Kind::kCut;
  const bool is_text =
      std::all_of(bytes + kHeaderBytes, bytes + kHeaderBytes + channel_bytes,
                  [](std::uint8_t character) { return character > ' ' && character <= '~'; });
  if (!is_text) return Kind::kNone;
  return header.end > file_.bytes() ? Kind::kCut : Kind::kRecord;
}

// True if the log ends at `offset`, or if a record begins there as far as its first word shows.
bool EventLogReader::RecordFollows(std::int64_t offset) const {
  if (offset == file_.bytes()) return true;
  Header header;
  return Look(offset, header) != Kind::kNone;
}

// Position of the first record in [from, limit); `limit` if there is none.
std::int64_t EventLogReader::FindRecord(std::int64_t from, std::int64_t limit) {
  for (std::int64_t at = from; at < limit; ++at) {
    const std::uint8_t* first = At(at, 1);
    if (first == nullptr) break;
    if (*first != kSync[0]) continue;
    Header header;
    if (Look(at, header) == Kind::kRecord && RecordFollows(header.end)) return at;
  }
  return limit;
}

// Moves to the next whole record and skips damaged bytes; false at the end of the log.
bool EventLogReader::Place(Header& header) {
  while (at_ < file_.bytes()) {
    const Kind kind = Look(at_, header);
    const bool whole = kind == Kind::kRecord;
    if (whole && RecordFollows(header.end)) return true;
    // If another record begins within this one, its lengths are wrong. Otherwise the bytes after it
    // are damaged.
    const std::int64_t limit = whole ? header.end : file_.bytes();
    const std::int64_t next = FindRecord(at_ + 1, limit);
    if (whole && next == limit) return true;
    if (kind == Kind::kCut && next == limit) {
      damage_.cut = true;
    } else {
      ++damage_.places;
      damage_.bytes += next - at_;
    }
    at_ = next;
  }
  return false;
}

// True for the first record of a log that follows another log: number 0, before number 1. A log of
// one record may be the last.
bool EventLogReader::BeginsLog(const Header& header) const {
  if (expected_ <= 0 || header.number != 0) return false;
  Header next;
  return header.end == file_.bytes() ||
         (Look(header.end, next) == Kind::kRecord && next.number == 1);
}

// True if the record may be used. If the number of the next record shows that only this number is
// wrong, this record is not trusted.
bool EventLogReader::NumberFits(const Header& header) {
  if (expected_ < 0 || header.number == expected_ || BeginsLog(header)) return true;
  Header next;
  const bool next_is_known = Look(header.end, next) == Kind::kRecord;
  if (next_is_known && next.number == expected_ + 1) {
    ++damage_.places;
    damage_.bytes += header.end - at_;
    ++damage_.missing;
    return false;
  }
  if (header.number > expected_) {
    damage_.missing += header.number - expected_;
  } else {
    ++damage_.places;  // of another log, or out of order
  }
  return true;
}

bool EventLogReader::Next(LogRecord& record) {
  for (Header header; Place(header);) {
    const std::int64_t begin = at_;
    logs_ += BeginsLog(header) ? 1 : 0;
    const bool fits = NumberFits(header);
    at_ = header.end;
    expected_ = fits ? header.number + 1 : expected_ + 1;
    if (!fits) continue;
    const auto channel_bytes = static_cast<std::size_t>(header.channel_bytes);
    const auto data_bytes = static_cast<std::size_t>(header.data_bytes);
    const std::uint8_t* const bytes = At(begin, kHeaderBytes + channel_bytes + data_bytes);
    if (bytes == nullptr) {
      damage_.cut = true;
      return false;
    }
    record.number = header.number;
    record.time_us = header.time_us;
    record.channel = {reinterpret_cast<const char*>(bytes) + kHeaderBytes, channel_bytes};
    record.data = {bytes + kHeaderBytes + channel_bytes, data_bytes};
    record.data_at = begin + static_cast<std::int64_t>(kHeaderBytes + channel_bytes);
    return true;
  }
  return false;
}

void EventLogReader::RequireOneLog() const {
  if (logs_ == 1) return;
  throw UserError(
      fmt::format("{}: {} logs are joined in it, and each is a separate session; "
                  "give each log by itself",
                  file_.path(), logs_));
}

void RequireOneLog(const std::string& path) {
  EventLogReader log(path);
  for (LogRecord record; log.Next(record);) {
  }
  log.RequireOneLog();
}

}  // namespace torquer
