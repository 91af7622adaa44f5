#include "host/simulator/live_readings.h"

#include <torquer_lcm/readings_t.hpp>
#include <vector>

#include "host/bus/clock.h"
#include "protocol/lcm_channels.h"

namespace torquer::simulator {

LiveReadings::LiveReadings(const ExchangeableSimulation& simulation, bus::Bus& bus)
    : simulation_(simulation), bus_(bus), any_(!simulation.now().Readings().empty()) {}

void LiveReadings::PublishWhenDue(std::int64_t now_us) {
  if (any_ && now_us - published_us_ >= kReadingsEveryUs) Publish();
}

void LiveReadings::Publish() {
  if (!any_) return;
  torquer_lcm::readings_t message{};
  message.tick = simulation_.now().tick();
  message.time_s = simulation_.now().time_s();
  for (effects::Reading& reading : simulation_.now().Readings()) {
    message.names.push_back(std::move(reading.name));
    message.values.push_back(reading.value);
  }
  message.count = static_cast<std::int32_t>(message.names.size());
  message.clock_id = bus::ClockId();
  message.publish_us = published_us_ = bus::MonotonicUs();
  bus_.Publish(protocol::kReadingsChannel, message);
}

}  // namespace torquer::simulator
