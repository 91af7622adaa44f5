#include "host/recorder/find_reading.h"

#include <algorithm>
#include <cmath>

#include "host/recorder/session_series.h"

namespace torquer {

std::optional<double> FindReading(const torquer_lcm::readings_t& readings,
                                  const std::string& name) {
  const auto found = std::find(readings.names.begin(), readings.names.end(), name);
  if (found == readings.names.end()) return std::nullopt;
  const double value = readings.values[static_cast<std::size_t>(found - readings.names.begin())];
  if (!(std::abs(value) <= Series::kMost)) return std::nullopt;
  return value;
}

std::optional<double> FindOverPlanes(const torquer_lcm::readings_t& readings,
                                     const std::string& name) {
  const std::optional<double> first = FindReading(readings, name);
  const std::string lateral = "lateral_" + name;
  const auto& names = readings.names;
  if (std::find(names.begin(), names.end(), lateral) == names.end()) return first;
  const std::optional<double> second = FindReading(readings, lateral);
  if (!first || !second) return std::nullopt;
  return *first + *second;
}

}  // namespace torquer
