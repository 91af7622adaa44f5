// Readings that are times of events.
#pragma once

#include <string_view>
#include <torquer_lcm/readings_t.hpp>

namespace torquer::bus {

/// Sets the times of events that have not happened to NaN. Earlier releases sent -1.
void ForgetNegativeEventTimes(torquer_lcm::readings_t& readings);

/// True if `name` is the time of an event, and the readings show that it has not happened.
bool NeverHappened(const torquer_lcm::readings_t& readings, std::string_view name);

}  // namespace torquer::bus
