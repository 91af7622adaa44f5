#include "host/simulator/sole_simulator.h"

#include <fmt/format.h>

#include <utility>

#include "host/bus/clock.h"
#include "host/support/error.h"
#include "host/support/printable_text.h"
#include "protocol/lcm_channels.h"

namespace torquer::simulator {

SoleSimulator::SoleSimulator(const std::string& url, const std::string& scene)
    : listener_(std::in_place, url),
      claim_(bus::BusClaimName("simulator", "", url),
             {.what = fmt::format("the bus at {}", listener_->url()),
              .program = "torquer-simulator",
              .detail = "scene " + scene}),
      began_us_(bus::MonotonicUs()) {
  listener_->SubscribeWithArrival<torquer_lcm::wire_state_t>(
      protocol::kWireStateChannel,
      [this](const torquer_lcm::wire_state_t& state, const bus::Arrival& arrival) {
        std::string instruments;
        for (const auto& instrument : state.instruments) {
          instruments += (instruments.empty() ? "" : ", ") + instrument.name;
        }
        heard_ = fmt::format("{} publishes wire states of {}", bus::Describe(arrival.sender),
                             Printable(instruments, 100));
      });
}

void SoleSimulator::Listen() {
  listener_->HandleUntil(began_us_ + kListenUs, [this] { return !heard_.empty(); });
  const std::string at = listener_->url();
  listener_.reset();
  if (heard_.empty()) return;
  throw UserError(fmt::format(
      "the bus at {} has a simulator, or a log player, already: {}; stop that, or choose another "
      "--lcm-url",
      at, heard_));
}

}  // namespace torquer::simulator
