#include "host/simulator/vessel/cache_folder.h"

#include <fcntl.h>
#include <sys/file.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <cstring>
#include <filesystem>
#include <string_view>
#include <system_error>
#include <tuple>
#include <vector>

#include "host/simulator/vessel/field_cache.h"

namespace torquer::vessel {

namespace {

constexpr std::string_view kEnding = ".field";
constexpr std::size_t kKeyDigits = 32;
constexpr std::size_t kRandomLetters = 7;  // ".XXXXXX" of mkostemp

// Kind of a file in the folder, by its name.
enum class Form { kOther, kField, kUnfinished };

Form FormOf(const std::string& name) {
  const std::size_t whole = kKeyDigits + kEnding.size();
  const bool begins = name.size() >= whole &&
                      name.find_first_not_of("0123456789abcdef") == kKeyDigits &&
                      name.compare(kKeyDigits, kEnding.size(), kEnding) == 0;
  if (!begins) return Form::kOther;
  if (name.size() == whole) return Form::kField;
  const bool is_unfinished = name.size() == whole + kRandomLetters && name[whole] == '.';
  return is_unfinished ? Form::kUnfinished : Form::kOther;
}

// True for an ordinary file of this user; false for a link in its place.
bool Own(const std::string& path, struct stat& status) {
  return lstat(path.c_str(), &status) == 0 && S_ISREG(status.st_mode) && status.st_uid == geteuid();
}

// True if no process writes the file any more: a writer holds a lock on it.
bool IsAbandoned(const std::string& path) {
  const int fd = open(path.c_str(), O_RDONLY | O_CLOEXEC | O_NOFOLLOW | O_NONBLOCK);
  if (fd < 0) return false;
  const bool abandoned = flock(fd, LOCK_EX | LOCK_NB) == 0;
  close(fd);
  return abandoned;
}

struct Field {
  std::string path;
  timespec used;
  std::int64_t bytes;
};

}  // namespace

void TidyCacheFolder(const std::string& folder, const std::string& keep, std::int64_t most_bytes) {
  std::vector<Field> fields;
  std::int64_t bytes = 0;
  std::error_code error;
  std::filesystem::directory_iterator entry(folder, error);
  for (; !error && entry != std::filesystem::directory_iterator(); entry.increment(error)) {
    const std::string path = entry->path().string();
    const Form form = FormOf(entry->path().filename().string());
    struct stat status {};
    if (form == Form::kOther || !Own(path, status)) continue;
    if (form == Form::kUnfinished) {
      if (IsAbandoned(path)) unlink(path.c_str());
    } else if (IsFieldCache(path)) {
      bytes += status.st_size;
      fields.push_back({path, status.st_mtim, status.st_size});
    }
  }
  std::sort(fields.begin(), fields.end(), [](const Field& a, const Field& b) {
    return std::tie(a.used.tv_sec, a.used.tv_nsec) < std::tie(b.used.tv_sec, b.used.tv_nsec);
  });
  for (const Field& field : fields) {
    if (bytes <= most_bytes) return;
    if (std::filesystem::path(field.path) == std::filesystem::path(keep)) continue;
    if (unlink(field.path.c_str()) == 0) bytes -= field.bytes;
  }
}

}  // namespace torquer::vessel
