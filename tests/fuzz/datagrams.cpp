// Fuzz target for datagrams on the bus's port: whole messages and fragments, from two senders. Each
// datagram is a packet (target.h) whose first byte is the sender.
#include <stdexcept>

#include "host/bus/udpm_datagram.h"
#include "tests/fuzz/target.h"

namespace torquer::fuzz::datagrams_target {
namespace {

void AppendBigEndian(Bytes& bytes, std::uint32_t value, int size) {
  for (int k = size - 1; k >= 0; --k) bytes.push_back(static_cast<std::uint8_t>(value >> 8 * k));
}

Bytes Whole(std::uint8_t sender, const std::string& channel, const std::string& data) {
  Bytes bytes = {sender, 'L', 'C', '0', '2', 0, 0, 0, 7};
  bytes.insert(bytes.end(), channel.begin(), channel.end());
  bytes.push_back(0);
  bytes.insert(bytes.end(), data.begin(), data.end());
  return bytes;
}

struct Fragment {
  std::uint32_t size, offset, number, count;
};

Bytes Part(std::uint8_t sender, const Fragment& fragment, const std::string& rest) {
  Bytes bytes = {sender, 'L', 'C', '0', '3', 0, 0, 0, 9};
  AppendBigEndian(bytes, fragment.size, 4);
  AppendBigEndian(bytes, fragment.offset, 4);
  AppendBigEndian(bytes, fragment.number, 2);
  AppendBigEndian(bytes, fragment.count, 2);
  bytes.insert(bytes.end(), rest.begin(), rest.end());
  return bytes;
}

std::vector<Bytes> Seeds() {
  Bytes whole, parts, mixed;
  AppendPacket(whole, Whole(1, "TORQUER_HEALTH", "12345678"));
  const std::string first = std::string("CHANNEL") + '\0' + "abcd";
  for (const auto& part :
       {Part(1, {9, 0, 0, 3}, first), Part(1, {9, 4, 1, 3}, "efg"), Part(1, {9, 7, 2, 3}, "hi")}) {
    AppendPacket(parts, part);
  }
  AppendPacket(mixed, Part(1, {5, 0, 0, 2}, first));
  AppendPacket(mixed, Part(2, {6, 0, 0, 2}, first));
  AppendPacket(mixed, Whole(1, "X", ""));
  AppendPacket(mixed, Part(2, {6, 4, 1, 2}, "ef"));
  AppendPacket(mixed, Part(1, {5, 4, 1, 2}, "e"));
  return {whole, parts, mixed};
}

// True if any message was completed.
bool Accepts(std::span<const std::uint8_t> input) {
  bus::UdpmAssembly assembly;
  bool any = false;
  for (Reader packets(input); !packets.empty();) {
    const auto packet = packets.Take(packets.Word());
    if (packet.empty()) continue;
    const bus::Sender sender{0x7f000001, static_cast<std::uint16_t>(packet[0] % 12)};
    // An exact copy, so that reading past the datagram's end is detected.
    const Bytes datagram(packet.begin() + 1, packet.end());
    bus::UdpmAssembly::Message message;
    if (assembly.Take(datagram, sender, message) != bus::UdpmAssembly::Outcome::kMessage) continue;
    any = true;
    std::uint64_t sum = 0;
    for (const char c : message.channel) sum += static_cast<std::uint8_t>(c);
    for (const std::uint8_t byte : message.data) sum += byte;
    if (sum > 255 * (message.channel.size() + message.data.size())) throw std::logic_error("sum");
  }
  return any;
}

const Registration kRegistration(
    {.name = "datagrams", .seeds = Seeds, .accepts = Accepts, .replay_inputs = 60000});

}  // namespace
}  // namespace torquer::fuzz::datagrams_target
