#include "host/support/event_log_writer.h"

#include <fcntl.h>
#include <fmt/format.h>
#include <unistd.h>

#include <cerrno>
#include <cstring>
#include <utility>

#include "host/support/error.h"

namespace torquer {
namespace {

constexpr std::size_t kMostWaiting = 1U << 16;

void PutBigEndian(std::vector<std::uint8_t>& bytes, std::int64_t value, int size) {
  for (int shift = 8 * (size - 1); shift >= 0; shift -= 8) {
    bytes.push_back(static_cast<std::uint8_t>(static_cast<std::uint64_t>(value) >> shift));
  }
}

}  // namespace

EventLogWriter::EventLogWriter(std::string path, std::int64_t first)
    : path_(std::move(path)),
      file_(open(path_.c_str(), O_WRONLY | O_CREAT | O_EXCL | O_CLOEXEC, 0644)),
      kept_(first),
      next_(first) {
  if (file_ >= 0) return;
  const int reason = errno;
  if (reason == EEXIST) {
    throw UserError(fmt::format("{}: exists already; give another name, or remove it", path_));
  }
  throw UserError(fmt::format("{}: cannot be made ({}); give a file in a folder of yours", path_,
                              std::strerror(reason)));
}

EventLogWriter::~EventLogWriter() { close(file_); }

void EventLogWriter::Write(std::int64_t time_us, std::string_view channel,
                           std::span<const std::uint8_t> data) {
  PutBigEndian(waiting_, 0xeda1da01, 4);
  PutBigEndian(waiting_, next_++, 8);
  PutBigEndian(waiting_, time_us, 8);
  PutBigEndian(waiting_, static_cast<std::int64_t>(channel.size()), 4);
  PutBigEndian(waiting_, static_cast<std::int64_t>(data.size()), 4);
  waiting_.insert(waiting_.end(), channel.begin(), channel.end());
  waiting_.insert(waiting_.end(), data.begin(), data.end());
  if (waiting_.size() >= kMostWaiting) Flush();
}

void EventLogWriter::Flush() {
  std::size_t done = 0;
  while (done < waiting_.size()) {
    const ssize_t size = write(file_, waiting_.data() + done, waiting_.size() - done);
    if (size < 0 && errno != EINTR) Fail(errno);
    if (size > 0) done += static_cast<std::size_t>(size);
  }
  kept_bytes_ += static_cast<std::int64_t>(waiting_.size());
  kept_ = next_;
  waiting_.clear();
}

void EventLogWriter::Finish() {
  Flush();
  if (fsync(file_) != 0) Fail(errno);
}

void EventLogWriter::Fail(int reason) {
  // A partial record would look like damage.
  const bool whole = ftruncate(file_, kept_bytes_) == 0;
  throw UserError(fmt::format(
      "{}: cannot be written ({}); it ends {} record {}, and {} are lost; "
      "free space, or record to another disk",
      path_, std::strerror(reason), whole ? "after" : "within or after", kept_, next_ - kept_));
}

}  // namespace torquer
