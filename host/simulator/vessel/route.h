// Shortest route along a network of centerlines.
#pragma once

#include <cstdint>
#include <vector>

#include "host/simulator/vessel/centerline.h"

namespace torquer::vessel {

/// Part of a route on one curve, which runs backward if to_mm < from_mm.
struct RouteLeg {
  std::size_t curve = 0;
  double from_mm = 0, to_mm = 0;
};

struct Route {
  bool connected = false;
  double length_mm = 0;
  std::vector<RouteLeg> legs;  ///< in their order, without those of no length
  /// Steps between neighbors that the search looked at: up to four for each place of a joint, and
  /// four.
  std::int64_t steps = 0;
};

/// Shortest route between two places of the network (Dijkstra, Numerische Mathematik 1959;1:269).
Route FindRoute(const CenterlineNetwork& network, const CenterlinePlace& from,
                const CenterlinePlace& to);

}  // namespace torquer::vessel
