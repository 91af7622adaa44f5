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
  const std::int64_t end_us = bus::MonotonicUs() + 1000 * kListenMs;
  for (std::int64_t now_us = 0; (now_us = bus::MonotonicUs()) < end_us && commanded.empty();) {
    listener.Handle(static_cast<int>((end_us - now_us) / 1000) + 1);
  }
  if (commanded.empty()) return;
  throw UserError(fmt::format(
      "--steer: on the bus at {} {} already; stop that one's program, or start the viewer without "
      "--steer",
      url, commanded));
}

}  // namespace torquer::viewer
