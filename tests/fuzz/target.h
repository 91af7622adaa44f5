// Fuzz target: one parser of the product, tested with arbitrary bytes.
//
// A target passes bytes to one parser and reports if they were accepted. In the asan build,
// fuzz-replay runs each target's seeds, its committed corpus and a fixed number of mutations of
// both.
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
  /// Inputs from the product's own writers, or from its documentation.
  std::vector<Bytes> (*seeds)();
  /// Passes the input to the parser; true if it was accepted. A UserError is a refusal; any other
  /// exception, and any report of a sanitizer, is a defect.
  bool (*accepts)(std::span<const std::uint8_t> input);
  /// Corrects checksums and lengths after a mutation, so that it reaches the code behind their
  /// checks. Null if the format has none.
  void (*repair)(Bytes& input) = nullptr;
  /// Number of mutations in fuzz-replay: two or three seconds under sanitizers.
  int replay_inputs = 10000;
  std::size_t longest = 4096;  ///< bytes per input
};

/// Target by name; for an unknown name, lists all targets and exits with status 2.
const Target& FindTarget(const std::string& name);
/// Names of all targets, in alphabetical order.
std::vector<std::string> TargetNames();
/// Runs the target; true if the input was accepted. An exception other than UserError ends the
/// program with its message.
bool Try(const Target& target, std::span<const std::uint8_t> input);

/// Registers a target for FindTarget(); one static object in each target's file.
struct Registration {
  explicit Registration(Target target);
};

/// Path of a file in memory with these bytes, mode 0600; valid until the next call.
std::string FileWith(std::span<const std::uint8_t> bytes);

inline Bytes ToBytes(std::string_view text) { return {text.begin(), text.end()}; }
inline std::string ToText(std::span<const std::uint8_t> bytes) {
  return {bytes.begin(), bytes.end()};
}
/// Contents of a file of the repository.
std::string SourceText(const std::string& path);

/// Reads an input from front to back; zeros after its end.
class Reader {
 public:
  explicit Reader(std::span<const std::uint8_t> bytes) : rest_(bytes) {}
  bool empty() const { return rest_.empty(); }
  std::uint8_t Byte() {
    const auto taken = Take(1);
    return taken.empty() ? 0 : taken[0];
  }
  std::uint16_t Word() { return static_cast<std::uint16_t>(Byte() | Byte() << 8); }
  /// Takes at most `size` bytes.
  std::span<const std::uint8_t> Take(std::size_t size) {
    const auto taken = rest_.first(size < rest_.size() ? size : rest_.size());
    rest_ = rest_.subspan(taken.size());
    return taken;
  }

 private:
  std::span<const std::uint8_t> rest_;
};

/// Appends a packet to an input: its length as a little-endian word, then its bytes.
void AppendPacket(Bytes& input, std::span<const std::uint8_t> packet);

}  // namespace torquer::fuzz
