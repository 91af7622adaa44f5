#include "host/support/log_parts.h"

#include <fmt/format.h>

#include <algorithm>
#include <charconv>
#include <filesystem>
#include <string_view>
#include <system_error>
#include <utility>

namespace torquer {
namespace {

constexpr std::string_view kMark = ".part";

// Number of a part from the end of the name; 0 if it does not name a part.
int PartNumber(std::string_view suffix) {
  if (!suffix.starts_with(kMark)) return 0;
  suffix.remove_prefix(kMark.size());
  int number = 0;
  const auto [end, error] =
      std::from_chars(suffix.data(), suffix.data() + suffix.size(), number, 10);
  const bool whole = error == std::errc() && end == suffix.data() + suffix.size();
  return whole && number >= 2 && fmt::format("{:03}", number) == suffix ? number : 0;
}

// Splits a path into the log and the number of the part.
std::pair<std::string, int> SplitPartPath(const std::string& path) {
  const std::size_t mark = path.rfind(kMark);
  const int number =
      mark == std::string::npos ? 0 : PartNumber(std::string_view(path).substr(mark));
  if (number == 0) return {path, 1};
  return {path.substr(0, mark), number};
}

// Numbers of the parts after `first`, ascending.
std::vector<int> LaterNumbers(const std::string& log, int first) {
  std::vector<int> numbers;
  const std::filesystem::path path(log);
  const std::string name = path.filename();
  std::error_code error;
  // A folder that cannot be listed counts as one without later parts; the named file is still read.
  std::filesystem::directory_iterator files(path.has_parent_path() ? path.parent_path() : ".",
                                            error);
  for (; !error && files != std::filesystem::directory_iterator(); files.increment(error)) {
    const std::string file = files->path().filename();
    if (!file.starts_with(name)) continue;
    const int number = PartNumber(std::string_view(file).substr(name.size()));
    if (number > first) numbers.push_back(number);
  }
  std::sort(numbers.begin(), numbers.end());
  return numbers;
}

}  // namespace

std::string LogPartPath(const std::string& path, int number) {
  return number == 1 ? path : fmt::format("{}{}{:03}", path, kMark, number);
}

std::vector<std::string> LaterLogParts(const std::string& path) {
  std::vector<std::string> parts;
  for (const int number : LaterNumbers(path, 1)) parts.push_back(LogPartPath(path, number));
  return parts;
}

LogInput::LogInput(const std::string& path, std::string remedy)
    : path_(path), remedy_(std::move(remedy)) {
  const auto [log, first] = SplitPartPath(path);
  std::vector<std::string> paths{path};
  for (const int number : LaterNumbers(log, first)) paths.push_back(LogPartPath(log, number));
  std::error_code error;
  const bool removed = first == 1 && paths.size() > 1 && !std::filesystem::exists(path, error);
  if (removed) paths.erase(paths.begin());
  for (std::string& part : paths) {
    const InputFile file(part, remedy_);
    parts_.push_back({std::move(part), bytes_, file.bytes()});
    bytes_ += file.bytes();
  }
}

const InputFile& LogInput::Open(std::size_t part) const {
  if (!file_ || open_ != part) {
    file_ = std::make_unique<InputFile>(parts_[part].path, remedy_);
    open_ = part;
  }
  return *file_;
}

std::size_t LogInput::ReadAt(std::int64_t offset, void* to, std::size_t size) const {
  const auto after =
      std::upper_bound(parts_.begin(), parts_.end(), offset,
                       [](std::int64_t at, const Part& part) { return at < part.begin; });
  std::size_t done = 0;
  for (auto part = after == parts_.begin() ? after : after - 1; part != parts_.end() && done < size;
       ++part) {
    const std::int64_t at = offset + static_cast<std::int64_t>(done) - part->begin;
    const std::int64_t there = std::max<std::int64_t>(part->bytes - at, 0);
    const auto want = std::min(size - done, static_cast<std::size_t>(there));
    if (want == 0) continue;
    const std::size_t got = Open(static_cast<std::size_t>(part - parts_.begin()))
                                .ReadAt(at, static_cast<char*>(to) + done, want);
    done += got;
    if (got < want) break;  // the file has become shorter
  }
  return done;
}

}  // namespace torquer
