#include "host/recorder/rotating_log.h"

#include <fmt/format.h>
#include <sys/statvfs.h>

#include <filesystem>
#include <limits>
#include <system_error>
#include <vector>

#include "host/support/error.h"
#include "host/support/log_parts.h"

namespace torquer {

RotatingLog::RotatingLog(const std::string& path, std::int64_t part_bytes, int keep)
    : path_(path), part_bytes_(part_bytes), keep_(keep) {
  // Readers would treat these files as parts of this log.
  const std::vector<std::string> others = LaterLogParts(path);
  if (!others.empty()) {
    throw UserError(
        fmt::format("{}: exists already, as a part of {}; give another name, or remove it",
                    others.front(), path));
  }
  const std::int64_t free = FreeBytes();
  if (free < kLeastFreeBytes) {
    throw UserError(
        fmt::format("{}: its disk has {} MB free, but a recording reserves {} MB for other "
                    "programs; free space, or record to another disk",
                    path, free / 1'000'000, kLeastFreeBytes / 1'000'000));
  }
  part_.emplace(path);
}

void RotatingLog::Write(std::int64_t time_us, std::string_view channel,
                        std::span<const std::uint8_t> data) {
  part_->Write(time_us, channel, data);
}

void RotatingLog::Flush() { part_->Flush(); }

void RotatingLog::Finish() { part_->Finish(); }

bool RotatingLog::Rotate() {
  if (part_->bytes() > 0) RemoveOldest();
  if (part_bytes_ == 0 || part_->bytes() < part_bytes_) return false;
  part_->Finish();
  earlier_bytes_ += part_->bytes();
  const std::int64_t next = part_->next();
  part_.emplace(LogPartPath(path_, ++number_), next);
  return true;
}

// Only once the newest part has records: a recording that ends before keeps those of the part
// before.
void RotatingLog::RemoveOldest() {
  for (; keep_ > 0 && number_ - removed_ > keep_; ++removed_) {
    part_->Flush();
    const std::string oldest = LogPartPath(path_, removed_ + 1);
    std::error_code error;
    std::filesystem::remove(oldest, error);
    if (!error) continue;
    throw UserError(
        fmt::format("{}: cannot be removed ({}); record in a folder of yours, or leave out --keep",
                    oldest, error.message()));
  }
}

std::int64_t RotatingLog::FreeBytes() const {
  const std::filesystem::path folder = std::filesystem::path(path_).parent_path();
  struct statvfs disk {};
  // If statvfs fails, a later write reports the error.
  if (statvfs(folder.empty() ? "." : folder.c_str(), &disk) != 0) {
    return std::numeric_limits<std::int64_t>::max();
  }
  return static_cast<std::int64_t>(disk.f_bavail * disk.f_frsize);
}

}  // namespace torquer
