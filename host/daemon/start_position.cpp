#include "host/daemon/start_position.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "host/bus/bus.h"
#include "host/bus/clock.h"
#include "host/support/error.h"
#include "host/support/printable_text.h"
#include "protocol/lcm_channels.h"
#include "torquer_lcm/instrument_command_t.hpp"
#include "torquer_lcm/wire_state_t.hpp"

namespace torquer::daemon {
namespace {

constexpr std::int64_t kListenUs = 400000;

// Tolerances between the simulator's last received pose and the daemon's last sent pose. They may
// differ by a message in flight.
constexpr double kSamePoseMm = 1.0;
constexpr double kSamePoseRad = 0.1;
// Largest accepted position, mm or rad; the simulator uses the same limit.
constexpr double kFarthest = 1e5;

// Messages received on the bus about one instrument.
struct BusState {
  std::optional<torquer_lcm::instrument_state_t> state;
  std::string others;  // instruments of a simulator that does not have this one
  bool commanded = false;
};

// Listens on a separate connection. The running daemon only sends, so that bus traffic of 1 kHz and
// more does not wake it.
BusState ListenFor(const std::string& instrument, const std::string& url) {
  BusState bus_state;
  bus::Bus listener(url);
  listener.Subscribe<torquer_lcm::wire_state_t>(
      protocol::kWireStateChannel, [&](const torquer_lcm::wire_state_t& state) {
        bus_state.others.clear();
        for (const auto& one : state.instruments) {
          if (one.name == instrument) bus_state.state = one;
          bus_state.others += (bus_state.others.empty() ? "" : ", ") + one.name;
        }
      });
  listener.Subscribe<torquer_lcm::instrument_command_t>(
      protocol::kInstrumentCommandChannel, [&](const torquer_lcm::instrument_command_t& command) {
        if (command.instrument == instrument) bus_state.commanded = true;
      });
  listener.HandleUntil(bus::MonotonicUs() + kListenUs, [&] { return bus_state.commanded; });
  return bus_state;
}

// True if `state` is within the limits that the simulator itself enforces. Any program on the bus
// may have sent it.
bool IsValid(const torquer_lcm::instrument_state_t& state) {
  const auto near = [](double value) { return std::abs(value) <= kFarthest; };
  return state.command_sequence >= 0 && near(state.commanded_insertion_mm) &&
         near(state.inserted_at_start_mm) && near(state.commanded_rotation_rad);
}

}  // namespace

StartPosition FindStart(const std::string& instrument, std::optional<LastCommand> previous,
                        const std::string& url) {
  StartPosition start;
  if (previous && previous->clock_id != bus::ClockId()) previous.reset();
  if (previous) start.sequence = protocol::NextSequence(previous->sequence);
  if (previous && bus::BoottimeUs() - previous->boottime_us > kTakeUpWithinS * 1000000LL) {
    previous.reset();
  }

  const BusState bus_state = ListenFor(instrument, url);
  if (bus_state.commanded) {
    throw UserError(fmt::format(
        "the instrument '{}' already gets commands on the bus at {}, from another "
        "machine or a log player; stop that, or choose another --instrument or --lcm-url",
        instrument, url));
  }
  if (!bus_state.state && !bus_state.others.empty()) {
    throw UserError(fmt::format(
        "the scene that runs on the bus at {} has no instrument '{}'; it has {}: give one of these "
        "with --instrument, or choose another --lcm-url",
        url, instrument, Printable(bus_state.others)));
  }
  if (previous) {
    start.pose = previous->pose;
    start.from = "the previous daemon";
  }
  if (bus_state.state && IsValid(*bus_state.state)) {
    const torquer_lcm::instrument_state_t& state = *bus_state.state;
    start.sequence = std::max(start.sequence, protocol::NextSequence(state.command_sequence));
    const double insertion_mm = state.commanded_insertion_mm - state.inserted_at_start_mm;
    const bool same =
        std::abs(insertion_mm - start.pose.insertion_mm) < kSamePoseMm &&
        std::abs(state.commanded_rotation_rad - start.pose.rotation_rad) < kSamePoseRad;
    if (!previous || !same) {
      start.pose.insertion_mm = insertion_mm;
      start.pose.rotation_rad = state.commanded_rotation_rad;
      start.from = "the simulator";
    }
  } else if (bus_state.state) {
    // This simulation has received no command yet, so earlier commands went to another one.
    start.pose = {};
    start.from.clear();
  }
  return start;
}

}  // namespace torquer::daemon
