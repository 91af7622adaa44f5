#include "host/bus/event_times.h"

#include <algorithm>
#include <cmath>
#include <iterator>
#include <limits>

namespace torquer::bus {
namespace {

// Time of an event, and the number of its events. No number: the time is always known.
struct EventTime {
  std::string_view time;
  std::string_view number;
};
constexpr EventTime kEventTimes[] = {{"wall_force_event_s", "wall_force_events"},
                                     {"left_model_event_s", "left_model_events"},
                                     {"target_reached_s", "target_reached"},
                                     {"injection_start_s", "injections"},
                                     {"mask_lost_s", ""}};

const EventTime* Find(std::string_view name) {
  const auto* const found =
      std::find_if(std::begin(kEventTimes), std::end(kEventTimes),
                   [name](const EventTime& event) { return event.time == name; });
  return found == std::end(kEventTimes) ? nullptr : found;
}

// Null if the readings do not have it.
const double* Value(const torquer_lcm::readings_t& readings, std::string_view name) {
  const auto found = std::find(readings.names.begin(), readings.names.end(), name);
  if (found == readings.names.end()) return nullptr;
  return &readings.values[static_cast<std::size_t>(found - readings.names.begin())];
}

}  // namespace

void ForgetNegativeEventTimes(torquer_lcm::readings_t& readings) {
  for (std::size_t k = 0; k < readings.names.size(); ++k) {
    if (readings.values[k] < 0 && Find(readings.names[k]) != nullptr) {
      readings.values[k] = std::numeric_limits<double>::quiet_NaN();
    }
  }
}

bool NeverHappened(const torquer_lcm::readings_t& readings, std::string_view name) {
  const EventTime* const event = Find(name);
  if (event == nullptr) return false;
  const double* const time_s = Value(readings, name);
  if (time_s == nullptr || !std::isnan(*time_s)) return false;
  const double* const number = Value(readings, event->number);
  return event->number.empty() || (number != nullptr && *number == 0);
}

}  // namespace torquer::bus
