// Fuzz target for commands from the bus to the simulator's loop, for instruments and the X-ray
// system. Whatever the commands and senders are, the resulting target must be finite. Each packet
// (target.h) has a sender, the milliseconds since the previous packet, and the message.
#include <stdexcept>

#include "host/bus/message_check.h"
#include "host/simulator/command_limits.h"
#include "host/simulator/live_commands.h"
#include "tests/fuzz/target.h"

namespace torquer::fuzz::commands_target {
namespace {

const scene::Scene& TheScene() {
  static const scene::Scene scene(scene::ParseScene(SourceText("host/scenes/drill_tube.toml"),
                                                    "drill_tube.toml", "host/scenes"));
  return scene;
}

std::vector<Bytes> Seeds() {
  Bytes input;
  for (int k = 0; k < 4; ++k) {
    torquer_lcm::instrument_command_t command{};
    command.instrument = "guidewire";
    command.sequence = k;
    command.insertion_mm = 0.1 * k;
    Bytes packet = {static_cast<std::uint8_t>(k / 3), 1};
    Bytes bytes(static_cast<std::size_t>(command.getEncodedSize()));
    command.encode(bytes.data(), 0, static_cast<int>(bytes.size()));
    packet.insert(packet.end(), bytes.begin(), bytes.end());
    AppendPacket(input, packet);
    torquer_lcm::imaging_command_t imaging{};
    imaging.sequence = k;
    imaging.mode = k;
    imaging.magnification = 1 + 0.5 * k;
    packet.resize(2);
    bytes.resize(static_cast<std::size_t>(imaging.getEncodedSize()));
    imaging.encode(bytes.data(), 0, static_cast<int>(bytes.size()));
    packet.insert(packet.end(), bytes.begin(), bytes.end());
    AppendPacket(input, packet);
    torquer_lcm::table_command_t table{};
    table.instrument = "guidewire";
    table.sequence = k;
    table.height_mm = 60.0 * k;
    packet.resize(2);
    bytes.resize(static_cast<std::size_t>(table.getEncodedSize()));
    table.encode(bytes.data(), 0, static_cast<int>(bytes.size()));
    packet.insert(packet.end(), bytes.begin(), bytes.end());
    AppendPacket(input, packet);
    torquer_lcm::wedge_command_t wedges{};
    wedges.sequence = k;
    wedges.share[k % 2] = 0.2 * k;
    packet.resize(2);
    bytes.resize(static_cast<std::size_t>(wedges.getEncodedSize()));
    wedges.encode(bytes.data(), 0, static_cast<int>(bytes.size()));
    packet.insert(packet.end(), bytes.begin(), bytes.end());
    AppendPacket(input, packet);
    torquer_lcm::injector_command_t injector{};
    injector.sequence = k;
    injector.order = k;
    injector.volume_mL = 60.0 * k;
    injector.rate_mL_s = 4;
    packet.resize(2);
    bytes.resize(static_cast<std::size_t>(injector.getEncodedSize()));
    injector.encode(bytes.data(), 0, static_cast<int>(bytes.size()));
    packet.insert(packet.end(), bytes.begin(), bytes.end());
    AppendPacket(input, packet);
    torquer_lcm::exchange_command_t exchange{};
    exchange.sequence = k;
    exchange.order = k / 2;
    exchange.instrument = "guidewire";
    exchange.device = "sion";
    packet.resize(2);
    bytes.resize(static_cast<std::size_t>(exchange.getEncodedSize()));
    exchange.encode(bytes.data(), 0, static_cast<int>(bytes.size()));
    packet.insert(packet.end(), bytes.begin(), bytes.end());
    AppendPacket(input, packet);
  }
  return {input};
}

bool Accepts(std::span<const std::uint8_t> input) {
  simulator::LiveCommands commands(TheScene());
  std::int64_t now_us = 10'000'000;
  for (Reader packets(input); !packets.empty();) {
    Reader packet(packets.Take(packets.Word()));
    const bus::Sender sender{0x7f000001, packet.Byte()};
    now_us += 1000 * packet.Byte();
    const auto bytes = packet.Take(4096);
    torquer_lcm::instrument_command_t message;
    if (bus::DecodeMessage(bytes.data(), bytes.size(), message)) {
      commands.Take(message, sender, now_us);
    }
    torquer_lcm::imaging_command_t imaging;
    if (bus::DecodeMessage(bytes.data(), bytes.size(), imaging)) {
      commands.Take(imaging, sender, now_us);
    }
    torquer_lcm::table_command_t table;
    if (bus::DecodeMessage(bytes.data(), bytes.size(), table)) {
      commands.Take(table, sender, now_us);
    }
    torquer_lcm::wedge_command_t wedges;
    if (bus::DecodeMessage(bytes.data(), bytes.size(), wedges)) {
      commands.Take(wedges, sender, now_us);
    }
    torquer_lcm::injector_command_t injector;
    if (bus::DecodeMessage(bytes.data(), bytes.size(), injector)) {
      commands.Take(injector, sender, now_us);
    }
    torquer_lcm::exchange_command_t exchange;
    if (bus::DecodeMessage(bytes.data(), bytes.size(), exchange)) {
      commands.Take(exchange, sender, now_us);
    }
    const std::optional<simulator::ExchangeOrder> order = commands.TakeExchange();
    if (order && order->instrument != 0) throw std::logic_error("an order for no instrument");
    commands.Age(now_us);
    const simulator::Command& wanted = commands.command();
    if (!simulator::IsValid(wanted.target[0]) || !simulator::IsValid(wanted.controls) ||
        !simulator::IsValid(wanted.controls.imaging) ||
        !simulator::InvalidValue(wanted.controls.injector).empty() ||
        !simulator::IsValid(wanted.controls.table)) {
      throw std::logic_error("what cannot be wanted is");
    }
    commands.State();
    commands.TakeNews();
  }
  torquer_lcm::wire_state_t state{};
  state.instruments.resize(1);  // instruments of the scene
  commands.Describe(state);
  return commands.taken() > 0;
}

const Registration kRegistration(
    {.name = "commands", .seeds = Seeds, .accepts = Accepts, .replay_inputs = 20000});

}  // namespace
}  // namespace torquer::fuzz::commands_target
