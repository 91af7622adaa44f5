#include "host/simulator/live_commands.h"

#include <algorithm>

#include "host/bus/clock.h"
#include "protocol/lcm_channels.h"

namespace torquer::simulator {

LiveCommands::LiveCommands(const Simulation& simulation)
    : simulation_(simulation),
      start_(simulation.scene().start()),
      clock_id_(bus::ClockId()),
      sources_(simulation.scene().instruments().size()) {
  command_.target = simulation.target();
  const std::int64_t now_us = bus::MonotonicUs();
  for (Source& source : sources_) source.origin_us = now_us;
}

void LiveCommands::Take(const torquer_lcm::instrument_command_t& message) {
  const std::vector<effects::Instrument>& all = simulation_.scene().instruments();
  const auto found = std::find_if(all.begin(), all.end(),
                                  [&](const auto& i) { return i.name == message.instrument; });
  if (found == all.end()) {
    ++unknown_;
    return;
  }
  const int k = static_cast<int>(found - all.begin());
  command_.target[k] = {start_[k].insertion_mm + message.insertion_mm, message.rotation_rad};
  if (k == 0) {
    command_.controls = {message.lao_rad, message.cra_rad, message.xray != 0,
                         message.contrast != 0};
  }
  const bool same_clock = message.clock_id == clock_id_;
  Source& source = sources_[static_cast<std::size_t>(k)];
  source.sequence = message.sequence;
  source.origin_us = same_clock ? message.origin_us : bus::MonotonicUs();
  source.in_doubt = (message.flags & (protocol::kCommandLift | protocol::kCommandSensorFault |
                                      protocol::kCommandNoDevice)) != 0;
  command_.in_doubt =
      std::any_of(sources_.begin(), sources_.end(), [](const Source& s) { return s.in_doubt; });
  sent_us_ = same_clock ? message.publish_us : 0;
  fresh_ = true;
  ++taken_;
}

void LiveCommands::Describe(torquer_lcm::wire_state_t& out) const {
  for (std::size_t k = 0; k < sources_.size(); ++k) {
    out.instruments[k].command_sequence = sources_[k].sequence;
    out.instruments[k].origin_us = sources_[k].origin_us;
  }
}

}  // namespace torquer::simulator
