// A parser of the product under bytes of any kind.
//
// A target gives one parser bytes and says whether they were accepted. fuzz-replay, in the asan
// build, tries each target's seeds, its committed corpus and a fixed number of mutations of both.
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <string>
#include <string_view>
#include <vector>

namespace torquer::fuzz {

using Bytes = std::vector<std::uint8_t>;

struct Target {
  std::string name;
  /// Inputs that the product's own writers made, or that its documentation has.
  std::vector<Bytes> (*seeds)();
  /// Gives the input to the parser; whether it was accepted. A UserError is a refusal; whatever
  /// else leaves this function, and any report of a sanitizer, is a defect.
  bool (*accepts)(std::span<const std::uint8_t> input);
  /// Makes checksums and lengths right again after a mutation, so that it reaches what lies behind
  /// them; null where the format has none.
  void (*repair)(Bytes& input) = nullptr;
  /// Inputs of fuzz-replay: what takes two or three seconds under sanitizers.
  int replay_inputs = 10000;
  std::size_t longest = 4096;  ///< bytes of an input
};

/// Exits with status 2, naming all, where there is none of that name.
const Target& FindTarget(const std::string& name);
/// Of all targets, in alphabetical order.
std::vector<std::string> TargetNames();
/// Runs the target; true where the input was accepted. An exception that is no UserError ends the
/// program with what it says.
bool Try(const Target& target, std::span<const std::uint8_t> input);

/// Makes a target known to FindTarget(); one static object in each target's file.
struct Registration {
  explicit Registration(Target target);
};

/// A file, open in memory, with these bytes; the path is good until the next call. Its mode is
/// 0600.
std::string FileWith(std::span<const std::uint8_t> bytes);

inline Bytes ToBytes(std::string_view text) { return {text.begin(), text.end()}; }
inline std::string ToText(std::span<const std::uint8_t> bytes) {
  return {bytes.begin(), bytes.end()};
}
/// The contents of a file of the repository.
std::string SourceText(const std::string& path);

/// Takes an input apart, front to back; zeros where it has ended.
class Reader {
 public:
  explicit Reader(std::span<const std::uint8_t> bytes) : rest_(bytes) {}
  bool empty() const { return rest_.empty(); }
  std::uint8_t Byte() {
    const auto taken = Take(1);
    return taken.empty() ? 0 : taken[0];
  }
  std::uint16_t Word() { return static_cast<std::uint16_t>(Byte() | Byte() << 8); }
  /// At most `size` bytes.
  std::span<const std::uint8_t> Take(std::size_t size) {
    const auto taken = rest_.first(size < rest_.size() ? size : rest_.size());
    rest_ = rest_.subspan(taken.size());
    return taken;
  }

 private:
  std::span<const std::uint8_t> rest_;
};

/// Packets in one input: each a word of length, little-endian, and its bytes.
void AppendPacket(Bytes& input, std::span<const std::uint8_t> packet);

}  // namespace torquer::fuzz
