#include "host/bus/message_check.h"

#include <algorithm>
#include <array>
#include <functional>
#include <map>
#include <stdexcept>
#include <string>
#include <vector>

namespace torquer::bus {
namespace {

// Upper limit in bytes. Our messages are far smaller, and every size up to it fits into an int.
constexpr std::size_t kLargestMessage = std::size_t{1} << 28;
// Maximum number of fields in one type that count the elements of other fields.
constexpr std::size_t kMostCounts = 8;
constexpr int kNoCount = -1;

// A field as it is written in a .lcm file.
struct FieldText {
  const char* type;
  const char* name;
  std::vector<const char*> dimensions;
};
using TypeTexts = std::map<std::string, std::vector<FieldText>, std::less<>>;

const TypeTexts& Texts() {
  static const TypeTexts texts = {
#include "torquer_lcm/message_layouts.inc"
  };
  return texts;
}

struct Layout;

// An array dimension: a fixed number, or the value of an earlier field.
struct Dimension {
  std::uint64_t number;
  int count;  // index of the counting field; kNoCount: use `number`
};

struct Field {
  std::size_t bytes = 0;  // bytes of one element of fixed size; 0: a text or a nested type
  const Layout* nested = nullptr;
  std::vector<Dimension> dimensions;
  int count = kNoCount;  // index under which its value is kept for the fields that it counts
};

struct Layout {
  std::vector<Field> fields;
};
using Layouts = std::map<std::string, Layout, std::less<>>;

std::size_t FixedBytes(std::string_view type) {
  static const std::map<std::string_view, std::size_t> bytes = {
      {"boolean", 1}, {"byte", 1},    {"int8_t", 1}, {"int16_t", 2},
      {"int32_t", 4}, {"int64_t", 8}, {"float", 4},  {"double", 8}};
  const auto found = bytes.find(type);
  return found == bytes.end() ? 0 : found->second;
}

// Parses a dimension: digits, or the name of an earlier field.
Dimension MakeDimension(const std::string& text, const std::map<std::string, int>& counts) {
  if (text.find_first_not_of("0123456789") == std::string::npos) {
    return {std::stoull(text), kNoCount};
  }
  const auto found = counts.find(text);
  if (found == counts.end()) throw std::logic_error("no earlier field " + text + " that counts");
  return {0, found->second};
}

bool CountsOthers(const FieldText& field, const std::vector<FieldText>& all) {
  if (!field.dimensions.empty() || !std::string_view(field.type).starts_with("int")) return false;
  return std::any_of(all.begin(), all.end(), [&](const FieldText& other) {
    return std::any_of(other.dimensions.begin(), other.dimensions.end(),
                       [&](std::string_view dimension) { return dimension == field.name; });
  });
}

// Adds the layout of type `name` and the layouts of its nested types.
const Layout& AddLayout(std::string_view name, Layouts& layouts) {
  const auto known = layouts.find(name);
  if (known != layouts.end()) return known->second;
  const auto text = Texts().find(name);
  if (text == Texts().end()) {
    throw std::logic_error("no message type " + std::string(name) + " in protocol/lcm");
  }
  Layout layout;
  std::map<std::string, int> counts;
  for (const FieldText& written : text->second) {
    Field field;
    field.bytes = FixedBytes(written.type);
    if (field.bytes == 0 && std::string_view(written.type) != "string") {
      field.nested = &AddLayout(written.type, layouts);
    }
    for (const char* dimension : written.dimensions) {
      field.dimensions.push_back(MakeDimension(dimension, counts));
    }
    if (CountsOthers(written, text->second)) {
      field.count = static_cast<int>(counts.size());
      if (counts.size() == kMostCounts) throw std::logic_error("more counts than kMostCounts");
      counts.emplace(written.name, field.count);
    }
    layout.fields.push_back(std::move(field));
  }
  return layouts.emplace(name, std::move(layout)).first->second;
}

const Layouts& AllLayouts() {
  static const Layouts all = [] {
    Layouts layouts;
    for (const auto& [name, text] : Texts()) AddLayout(name, layouts);
    return layouts;
  }();
  return all;
}

// Walks over the bytes of a message and stops at the first invalid one.
class Walk {
 public:
  explicit Walk(std::span<const std::uint8_t> bytes) : bytes_(bytes), rest_(bytes) {}

  bool AtEnd() const { return rest_.empty(); }

  bool Integer(std::size_t size, std::int64_t& value) {
    if (size > rest_.size()) return false;
    std::uint64_t bits = (rest_[0] & 0x80) != 0 ? ~std::uint64_t{0} : 0;
    for (const std::uint8_t byte : rest_.first(size)) bits = bits << 8 | byte;
    value = static_cast<std::int64_t>(bits);
    rest_ = rest_.subspan(size);
    return true;
  }

  bool Struct(const Layout& layout) {
    std::array<std::int64_t, kMostCounts> counts{};
    for (const Field& field : layout.fields) {
      if (field.count != kNoCount) {
        // A decoder allocates this many elements before it reads any. If another dimension is zero,
        // the elements take no bytes, so the size check below does not limit the count.
        std::int64_t& count = counts[static_cast<std::size_t>(field.count)];
        if (!Integer(field.bytes, count)) return false;
        // A negative count becomes a huge unsigned number and is refused too.
        if (static_cast<std::uint64_t>(count) > bytes_.size()) return false;
        continue;
      }
      std::uint64_t elements = 1;
      for (const Dimension& dimension : field.dimensions) {
        elements *=
            dimension.count == kNoCount
                ? dimension.number
                : static_cast<std::uint64_t>(counts[static_cast<std::size_t>(dimension.count)]);
        if (elements == 0) break;
        if (elements > bytes_.size()) return false;
      }
      if (!Elements(field, elements)) return false;
    }
    return true;
  }

 private:
  bool Elements(const Field& field, std::uint64_t number) {
    if (field.bytes > 0) {
      if (number > rest_.size() / field.bytes) return false;
      rest_ = rest_.subspan(field.bytes * number);
      return true;
    }
    // Each element takes at least one byte, so the loop ends when the bytes do.
    for (; number > 0; --number) {
      if (!(field.nested != nullptr ? Struct(*field.nested) : Text())) return false;
    }
    return true;
  }

  // A text: its length including the final zero byte, then that many bytes.
  bool Text() {
    std::int64_t length = 0;
    if (!Integer(4, length) || length <= 0) return false;
    if (static_cast<std::uint64_t>(length) > rest_.size()) return false;
    const auto size = static_cast<std::size_t>(length);
    const auto text = rest_.first(size);
    rest_ = rest_.subspan(size);
    return std::find(text.begin(), text.end(), 0) == text.end() - 1;
  }

  std::span<const std::uint8_t> bytes_;
  std::span<const std::uint8_t> rest_;
};

}  // namespace

bool IsMessage(std::string_view type_name, std::int64_t fingerprint,
               std::span<const std::uint8_t> bytes) {
  const auto layout = AllLayouts().find(type_name);
  if (layout == AllLayouts().end()) {
    throw std::logic_error("no message type " + std::string(type_name) + " in protocol/lcm");
  }
  Walk walk(bytes);
  std::int64_t found = 0;
  return bytes.size() <= kLargestMessage && walk.Integer(8, found) && found == fingerprint &&
         walk.Struct(layout->second) && walk.AtEnd();
}

}  // namespace torquer::bus
