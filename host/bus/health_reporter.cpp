#include "host/bus/health_reporter.h"

#include "host/bus/clock.h"
#include "protocol/lcm_channels.h"
#include "torquer_lcm/health_t.hpp"

namespace torquer::bus {

HealthReporter::HealthReporter(Bus& bus, std::string process)
    : bus_(bus), process_(std::move(process)), state_("starting") {}

void HealthReporter::Change(const std::string& state, const std::string& message,
                            const HealthCounters& counters) {
  state_ = state;
  Publish(message, counters);
}

void HealthReporter::Repeat(const HealthCounters& counters) { Publish("", counters); }

void HealthReporter::Publish(const std::string& message, const HealthCounters& counters) {
  torquer_lcm::health_t health;
  health.process = process_;
  health.device = device_;
  health.instrument = instrument_;
  health.clock_id = ClockId();
  health.publish_us = MonotonicUs();
  health.state = state_;
  health.message = message;
  for (const auto& [name, value] : counters) {
    if (!value) continue;
    health.names.push_back(name);
    health.values.push_back(*value);
  }
  health.count = static_cast<std::int32_t>(health.names.size());
  last_publish_us_ = health.publish_us;
  bus_.Publish(protocol::kHealthChannel, health);
}

}  // namespace torquer::bus
