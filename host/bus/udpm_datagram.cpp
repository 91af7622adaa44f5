#include "host/bus/udpm_datagram.h"

#include <algorithm>

namespace torquer::bus {
namespace {

constexpr std::uint32_t kWhole = 0x4c433032;     // "LC02"
constexpr std::uint32_t kFragment = 0x4c433033;  // "LC03"
constexpr std::size_t kWholeHeader = 8;          // the magic number and a sequence number
constexpr std::size_t kFragmentHeader = 20;
constexpr std::size_t kLongestChannel = 63;

std::uint32_t BigEndian(std::span<const std::uint8_t> bytes, std::size_t at, std::size_t size) {
  std::uint32_t value = 0;
  for (const std::uint8_t byte : bytes.subspan(at, size)) value = value << 8 | byte;
  return value;
}

// Removes the zero-terminated channel name from the front of `bytes`; "" if there is none.
std::string_view TakeChannel(std::span<const std::uint8_t>& bytes) {
  const auto end = std::find(bytes.begin(), bytes.end(), 0);
  const auto length = static_cast<std::size_t>(end - bytes.begin());
  if (end == bytes.end() || length > kLongestChannel) return {};
  const std::string_view channel(reinterpret_cast<const char*>(bytes.data()), length);
  bytes = bytes.subspan(length + 1);
  return channel;
}

}  // namespace

UdpmAssembly::Outcome UdpmAssembly::Take(std::span<const std::uint8_t> datagram,
                                         const Sender& sender, Message& message) {
  if (datagram.size() < kWholeHeader) return Outcome::kRefused;
  const std::uint32_t kind = BigEndian(datagram, 0, 4);
  if (kind == kFragment) return TakeFragment(datagram, sender, message);
  if (kind != kWhole) return Outcome::kRefused;
  message.data = datagram.subspan(kWholeHeader);
  message.channel = TakeChannel(message.data);
  return message.channel.empty() ? Outcome::kRefused : Outcome::kMessage;
}

UdpmAssembly::Outcome UdpmAssembly::TakeFragment(std::span<const std::uint8_t> datagram,
                                                 const Sender& sender, Message& message) {
  if (datagram.size() < kFragmentHeader) return Outcome::kRefused;
  const std::uint32_t number = BigEndian(datagram, 4, 4);
  const std::size_t size = BigEndian(datagram, 8, 4);
  const std::size_t offset = BigEndian(datagram, 12, 4);
  const std::uint32_t fragment = BigEndian(datagram, 16, 2);
  const std::uint32_t fragments = BigEndian(datagram, 18, 2);
  std::span<const std::uint8_t> data = datagram.subspan(kFragmentHeader);

  auto assembly = std::find_if(assemblies_.begin(), assemblies_.end(),
                               [&](const Assembly& known) { return known.sender == sender; });
  if (fragment == 0) {
    // A sender finishes a message before it begins the next, so the rest of its last one is lost.
    if (assembly != assemblies_.end()) assemblies_.erase(assembly);
    const std::string_view channel = TakeChannel(data);
    if (channel.empty() || size > kLargestMessage) return Outcome::kRefused;
    if (assemblies_.size() == kMostAssemblies) assemblies_.pop_front();
    assembly = assemblies_.insert(assemblies_.end(),
                                  {sender, number, size, fragments, 0, std::string(channel), {}});
  }
  if (assembly == assemblies_.end()) return Outcome::kRefused;
  const bool follows = assembly->number == number && assembly->size == size &&
                       assembly->fragments == fragments && assembly->taken == fragment &&
                       assembly->data.size() == offset && data.size() <= size - offset;
  if (!follows) {
    assemblies_.erase(assembly);
    return Outcome::kRefused;
  }
  assembly->data.insert(assembly->data.end(), data.begin(), data.end());
  if (++assembly->taken < assembly->fragments) return Outcome::kFragment;
  done_ = std::move(*assembly);
  assemblies_.erase(assembly);
  message = {done_.channel, done_.data};
  return done_.data.size() == done_.size ? Outcome::kMessage : Outcome::kRefused;
}

}  // namespace torquer::bus
