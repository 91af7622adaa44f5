#include "host/viewer/sole_hand.h"

#include <fmt/format.h>

#include <torquer_lcm/instrument_command_t.hpp>

#include "host/bus/bus.h"
#include "host/bus/clock.h"
#include "host/support/error.h"
#include "host/support/printable_text.h"
#include "protocol/lcm_channels.h"

namespace torquer::viewer {

SoleHand::SoleHand(const std::string& url)
    : claim_(bus::BusClaimName("steering", "", url),
             {.what = fmt::format("steering on the bus at {}", url), .program = "torquer-viewer"}) {
  std::string commanded;
  bus::Bus listener(url);
  listener.SubscribeWithArrival<torquer_lcm::instrument_command_t>(
      protocol::kInstrumentCommandChannel,
      [&](const torquer_lcm::instrument_command_t& command, const bus::Arrival& arrival) {
        commanded = fmt::format("'{}' gets commands from {}", Printable(command.instrument, 40),
                                bus::Describe(arrival.sender));
      });
  listener.HandleUntil(bus::MonotonicUs() + 1000 * kListenMs, [&] { return !commanded.empty(); });
  if (commanded.empty()) return;
  throw UserError(fmt::format(
      "--steer: on the bus at {} {} already; stop that one's program, or start the viewer without "
      "--steer",
      url, commanded));
}

}  // namespace torquer::viewer
