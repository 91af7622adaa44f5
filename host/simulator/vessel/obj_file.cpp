#include "host/simulator/vessel/obj_file.h"

#include <algorithm>
#include <cstddef>
#include <string_view>

namespace torquer::vessel {

namespace {

constexpr std::string_view kObjBlanks = " \t\v\f";
constexpr std::string_view kObjByteOrderMark = "\xef\xbb\xbf";

// Next word of a line, which becomes shorter; empty at its end.
std::string_view NextWord(std::string_view& line) {
  line.remove_prefix(std::min(line.find_first_not_of(kObjBlanks), line.size()));
  const std::string_view word = line.substr(0, line.find_first_of(kObjBlanks));
  line.remove_prefix(word.size());
  return word;
}

// Appends the words of a line that continue or begin an element. Returns true if the next line
// continues it.
bool AppendWords(std::string_view line, bool is_face, std::string& out) {
  for (std::string_view word = NextWord(line); !word.empty(); word = NextWord(line)) {
    const bool continues = word.back() == '\\';
    if (continues) word.remove_suffix(1);
    // A face's corner is VERTEX/TEXTURE/NORMAL.
    if (is_face) word = word.substr(0, word.find('/'));
    if (!word.empty()) (out += ' ') += word;
    if (continues) return true;
  }
  return false;
}

}  // namespace

std::string OnlyFaces(const std::string& contents) {
  std::string out;
  out.reserve(contents.size());
  bool continues = false, is_kept = false, is_face = false;
  const std::size_t begin = contents.starts_with(kObjByteOrderMark) ? kObjByteOrderMark.size() : 0;
  for (std::size_t at = begin; at < contents.size();) {
    const std::size_t end = std::min(contents.find_first_of("\n\r", at), contents.size());
    std::string_view line(contents.data() + at, end - at);
    at = end + 1;
    // The two bytes of a line's end in files of Windows make an empty line.
    if (line.empty() && end > 0 && end < contents.size() && contents[end] == '\n' &&
        contents[end - 1] == '\r') {
      continue;
    }
    if (!continues) {
      const std::string_view kind = NextWord(line);
      is_face = kind == "f";
      is_kept = is_face || kind == "v";
      if (is_kept) out += kind;
    }
    if (is_kept) {
      continues = AppendWords(line, is_face, out);
      if (!continues) out += '\n';
    } else {
      continues = line.ends_with('\\');
    }
  }
  if (continues) out += '\n';
  return out;
}

}  // namespace torquer::vessel
