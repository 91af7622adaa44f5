#include "tests/fuzz/mutation.h"

#include <algorithm>
#include <array>

namespace torquer::fuzz {
namespace {

// Numbers that parsers often mishandle, as text.
constexpr std::array<std::string_view, 16> kTokens = {
    "-1", "0",  "1e999", "nan", "-inf", "4294967296", "9223372036854775808",  "1e-320",
    "[",  "\"", "\n",    "]",   "{",    "=",          "99999999999999999999", "\xff\xfe"};
constexpr std::array<std::uint32_t, 8> kNumbers = {0,          1,          0x7f,       0xffff,
                                                   0x7fffffff, 0x80000000, 0xffffffff, 0x20000001};

class Mutator {
 public:
  Mutator(Bytes bytes, std::mt19937& random) : bytes_(std::move(bytes)), random_(random) {}

  void Change(const std::vector<Bytes>& others) {
    if (bytes_.empty()) bytes_.push_back(0);
    const std::size_t at = Below(bytes_.size());
    switch (Below(9)) {
      case 0:
        bytes_[at] = static_cast<std::uint8_t>(random_());
        break;
      case 1:
        bytes_[at] = static_cast<std::uint8_t>(bytes_[at] ^ 1U << Below(8));
        break;
      case 2:
        PutNumber(at);
        break;
      case 3:
        bytes_.erase(At(at), At(at + std::min(bytes_.size() - at, 1 + Below(16))));
        break;
      case 4:
        bytes_.resize(at);
        break;
      case 5:
        Repeat(at);
        break;
      case 6:
        Insert(at, kTokens[Below(kTokens.size())]);
        break;
      case 7:
        ReplaceWord(at);
        break;
      default:
        Splice(at, others[Below(others.size())]);
    }
  }
  Bytes Take() { return std::move(bytes_); }

 private:
  std::size_t Below(std::size_t n) { return static_cast<std::size_t>(random_()) % n; }
  Bytes::iterator At(std::size_t at) { return bytes_.begin() + static_cast<std::ptrdiff_t>(at); }

  void PutNumber(std::size_t at) {
    const std::uint32_t number = kNumbers[Below(kNumbers.size())];
    const bool big_endian = Below(2) == 0;
    for (std::size_t k = 0; k < 4 && at + k < bytes_.size(); ++k) {
      bytes_[at + k] = static_cast<std::uint8_t>(number >> 8 * (big_endian ? 3 - k : k));
    }
  }
  void Repeat(std::size_t at) {
    const Bytes part(At(at), At(at + std::min(bytes_.size() - at, 1 + Below(64))));
    for (std::size_t times = 1 + Below(8); times > 0; --times) {
      bytes_.insert(At(at), part.begin(), part.end());
    }
  }
  void Insert(std::size_t at, std::string_view text) {
    bytes_.insert(At(at), text.begin(), text.end());
  }
  // Replaces a number or a name in a text.
  void ReplaceWord(std::size_t at) {
    const auto is_word = [](std::uint8_t c) {
      return (c >= '0' && c <= '9') || (c >= 'a' && c <= 'z') || c == '.' || c == '-' || c == '_';
    };
    std::size_t end = at;
    while (end < bytes_.size() && is_word(bytes_[end])) ++end;
    bytes_.erase(At(at), At(end));
    Insert(at, kTokens[Below(kTokens.size())]);
  }
  void Splice(std::size_t at, const Bytes& other) {
    const std::size_t from = Below(other.size());
    bytes_.resize(at);
    bytes_.insert(bytes_.end(), other.begin() + static_cast<std::ptrdiff_t>(from), other.end());
  }

  Bytes bytes_;
  std::mt19937& random_;
};

}  // namespace

Bytes Mutate(const Target& target, const std::vector<Bytes>& inputs, std::mt19937& random) {
  Mutator mutator(inputs[random() % inputs.size()], random);
  for (std::size_t changes = 1 + random() % 6; changes > 0; --changes) mutator.Change(inputs);
  Bytes bytes = mutator.Take();
  bytes.resize(std::min(bytes.size(), target.longest));
  if (target.repair != nullptr) target.repair(bytes);
  return bytes;
}

}  // namespace torquer::fuzz
