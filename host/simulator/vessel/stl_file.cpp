#include "host/simulator/vessel/stl_file.h"

#include <fmt/format.h>

#include <algorithm>
#include <bit>
#include <cctype>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <optional>
#include <string_view>

#include "host/support/error.h"
#include "host/support/number.h"
#include "host/support/printable_text.h"

namespace torquer::vessel {

namespace {

constexpr std::size_t kStlHeaderBytes = 80, kStlCountBytes = 4, kFacetBytes = 50;
constexpr std::size_t kStlBeginBytes = kStlHeaderBytes + kStlCountBytes;
constexpr std::string_view kByteOrderMark = "\xef\xbb\xbf";
constexpr std::string_view kStlBlanks = " \t\r\n\v\f";

static_assert(std::endian::native == std::endian::little, "binary STL is little-endian");

[[noreturn]] void Refuse(const std::string& path, const std::string& what) {
  throw UserError(path + ": " + what);
}

// Words of a text; each line's end is a blank.
class Words {
 public:
  Words(std::string_view text, const std::string& path) : rest_(text), path_(path) {
    if (rest_.starts_with(kByteOrderMark)) rest_.remove_prefix(kByteOrderMark.size());
  }

  // Empty at the end.
  std::string_view Next() {
    SkipBlanks();
    const std::string_view word = rest_.substr(0, rest_.find_first_of(kStlBlanks));
    rest_.remove_prefix(word.size());
    return word;
  }
  // The rest of a line is a name, which may look like anything.
  void SkipLine() { rest_.remove_prefix(std::min(rest_.find('\n'), rest_.size())); }

  double Number(const char* axis) {
    const std::string_view word = Next();
    const std::optional<double> value = ParseNumber(word);
    if (!value) {
      RefuseHere(
          fmt::format("{} of a vertex is '{}', not a finite number", axis, Printable(word, 40)));
    }
    return *value;
  }

  [[noreturn]] void RefuseHere(const std::string& what) const {
    throw UserError(fmt::format("{}:{}: {}; the file is damaged or cut short: export it again",
                                path_, line_, what));
  }

 private:
  void SkipBlanks() {
    const std::size_t blanks = std::min(rest_.find_first_not_of(kStlBlanks), rest_.size());
    line_ += std::count(rest_.begin(), rest_.begin() + static_cast<std::ptrdiff_t>(blanks), '\n');
    rest_.remove_prefix(blanks);
  }

  std::string_view rest_;
  const std::string& path_;
  std::ptrdiff_t line_ = 1;
};

bool IsWord(std::string_view word, std::string_view lower_case) {
  return std::equal(word.begin(), word.end(), lower_case.begin(), lower_case.end(),
                    [](unsigned char a, unsigned char b) { return std::tolower(a) == b; });
}

// Triangles that a binary file announces, if it is long enough to announce any.
std::optional<std::size_t> BinaryCount(const std::string& contents) {
  if (contents.size() < kStlBeginBytes) return std::nullopt;
  std::uint32_t count = 0;
  std::memcpy(&count, contents.data() + kStlHeaderBytes, sizeof count);
  return count;
}

// Binary files may begin with "solid", too, but hold bytes that no text holds.
bool IsText(const std::string& contents, const std::string& path) {
  const auto count = BinaryCount(contents);
  if (count && contents.size() == kStlBeginBytes + *count * kFacetBytes) return false;
  const std::string_view begin = std::string_view(contents).substr(0, 1024);
  return IsWord(Words(begin, path).Next(), "solid") && begin.find('\0') == std::string_view::npos;
}

TriangleMesh ParseText(const std::string& contents, const std::string& path, double mm_per_unit) {
  TriangleMesh mesh;
  Words words(contents, path);
  std::int32_t corners = 0;
  bool is_open = false;
  for (std::string_view word = words.Next(); !word.empty(); word = words.Next()) {
    if (IsWord(word, "solid") || IsWord(word, "endsolid")) {
      is_open = IsWord(word, "solid");
      words.SkipLine();
    } else if (IsWord(word, "vertex")) {
      if (++corners > 3) words.RefuseHere("a facet has more than three vertices");
      const double x = words.Number("x"), y = words.Number("y"), z = words.Number("z");
      mesh.vertices_mm.emplace_back(mm_per_unit * x, mm_per_unit * y, mm_per_unit * z);
    } else if (IsWord(word, "endfacet")) {
      if (corners != 3) words.RefuseHere(fmt::format("a facet has {} vertices, not 3", corners));
      const auto first = static_cast<std::int32_t>(mesh.vertices_mm.size()) - 3;
      mesh.triangles.push_back({first, first + 1, first + 2});
      corners = 0;
    }
    // Normals follow from the vertices.
  }
  if (is_open || corners > 0) words.RefuseHere("the file does not end with \"endsolid\"");
  return mesh;
}

TriangleMesh ParseBinary(const std::string& contents, const std::string& path, double mm_per_unit) {
  const auto count = BinaryCount(contents);
  if (!count) {
    Refuse(path, fmt::format("not an STL file: it has {} bytes and does not begin with \"solid\"; "
                             "export the surface again",
                             contents.size()));
  }
  const std::size_t room = contents.size() - kStlBeginBytes, wanted = *count * kFacetBytes;
  if (room < wanted) {
    Refuse(path, fmt::format("the header announces {} triangles, but the file has room for {}; it "
                             "is cut short, or no STL file: export it again",
                             *count, room / kFacetBytes));
  }
  // If less than one triangle follows the last one, the surface is complete.
  if (room - wanted >= kFacetBytes) {
    Refuse(path, fmt::format("{} bytes follow the {} triangles that the header announces, enough "
                             "for further ones; export it again as one surface",
                             room - wanted, *count));
  }
  TriangleMesh mesh;
  mesh.vertices_mm.reserve(3 * *count);
  mesh.triangles.reserve(*count);
  for (std::size_t k = 0; k < *count; ++k) {
    float numbers[12];  // the normal, then the corners
    std::memcpy(numbers, contents.data() + kStlBeginBytes + k * kFacetBytes, sizeof numbers);
    const auto first = static_cast<std::int32_t>(mesh.vertices_mm.size());
    for (int c = 3; c < 12; c += 3) {
      mesh.vertices_mm.emplace_back(mm_per_unit * static_cast<double>(numbers[c]),
                                    mm_per_unit * static_cast<double>(numbers[c + 1]),
                                    mm_per_unit * static_cast<double>(numbers[c + 2]));
    }
    mesh.triangles.push_back({first, first + 1, first + 2});
  }
  return mesh;
}

}  // namespace

TriangleMesh ParseStl(const std::string& contents, const std::string& path, double mm_per_unit) {
  return IsText(contents, path) ? ParseText(contents, path, mm_per_unit)
                                : ParseBinary(contents, path, mm_per_unit);
}

}  // namespace torquer::vessel
