// Fuzz target for the bus display of torquer-monitor. Any messages must give one line that a
// terminal shows as text. Each packet (target.h) is a message; its first byte selects the type.
#include "host/tools/live_status.h"

#include <stdexcept>

#include "host/bus/message_check.h"
#include "tests/fuzz/target.h"
#include "tests/support/sample_messages.h"

namespace torquer::fuzz::live_status_target {
namespace {

const char* const kTypes[] = {"device_sample_t", "wire_state_t", "scene_description_t", "health_t",
                              "readings_t"};

std::vector<Bytes> Seeds() {
  Bytes input;
  for (std::size_t type = 0; type < std::size(kTypes); ++type) {
    for (const auto& sample : test::SampleMessages()) {
      if (sample.type != kTypes[type]) continue;
      Bytes packet = {static_cast<std::uint8_t>(type)};
      packet.insert(packet.end(), sample.bytes.begin(), sample.bytes.end());
      AppendPacket(input, packet);
    }
  }
  return {input};
}

void MustBeText(const std::string& line) {
  for (const char c : line) {
    const auto byte = static_cast<unsigned char>(c);
    if (byte < ' ' || byte == 0x7f) throw std::logic_error("a control character is shown");
  }
}

template <class Message, class Use>
bool Give(std::span<const std::uint8_t> bytes, const Use& use) {
  Message message;
  if (!bus::DecodeMessage(bytes.data(), bytes.size(), message)) return false;
  use(message);
  return true;
}

bool Accepts(std::span<const std::uint8_t> input) {
  using namespace torquer_lcm;
  tools::LiveStatus status(0);
  std::int64_t now_us = 1'000'000;
  bool any = false;
  for (Reader packets(input); !packets.empty(); now_us += 100'000) {
    const auto packet = packets.Take(packets.Word());
    if (packet.empty()) continue;
    const auto bytes = packet.subspan(1);
    const auto add = [&](const auto& message) { status.Add(message); };
    // More simulators than the display names.
    const bus::Sender sender{0x7f000001, static_cast<std::uint16_t>(now_us / 100'000 % 7)};
    switch (packet[0] % std::size(kTypes)) {
      case 0:
        any |= Give<device_sample_t>(bytes, add);
        break;
      case 1:
        any |= Give<wire_state_t>(bytes, [&](const auto& m) { status.Add(m, sender, now_us); });
        break;
      case 2:
        any |= Give<scene_description_t>(bytes, [&](const auto& m) { status.Add(m, sender); });
        break;
      case 3:
        any |= Give<health_t>(bytes, [&](const auto& m) { MustBeText(status.Add(m, now_us)); });
        break;
      default:
        any |= Give<readings_t>(bytes, [&](const auto& m) { MustBeText(status.Add(m)); });
    }
    MustBeText(status.Line(0.1, now_us));
  }
  return any;
}

const Registration kRegistration(
    {.name = "live_status", .seeds = Seeds, .accepts = Accepts, .replay_inputs = 6000});

}  // namespace
}  // namespace torquer::fuzz::live_status_target
