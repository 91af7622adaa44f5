#include "host/simulator/vessel/route.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numeric>
#include <queue>
#include <utility>

namespace torquer::vessel {

namespace {

constexpr double kFar = std::numeric_limits<double>::infinity();
constexpr std::size_t kNone = std::numeric_limits<std::size_t>::max();
constexpr double kNoLengthMm = 1e-3;

// The graph that is searched. Its nodes are stops on curves, then joints:
//
//   stop --- stop --- stop      along one curve, neighbors by arc length
//     \       /
//       joint                   to each of its stops, without length
class RouteGraph {
 public:
  RouteGraph(const CenterlineNetwork& network, const CenterlinePlace& from,
             const CenterlinePlace& to)
      : stops_{from, to}, joint_of_{kNone, kNone} {
    for (const CenterlineNetwork::Joint& joint : network.joints()) {
      std::vector<std::size_t>& stops = stops_of_.emplace_back();
      for (const CenterlinePlace& place : joint.places) {
        stops.push_back(stops_.size());
        stops_.push_back(place);
        joint_of_.push_back(stops_of_.size() - 1);
      }
    }
    order_.resize(stops_.size());
    std::iota(order_.begin(), order_.end(), std::size_t{0});
    std::sort(order_.begin(), order_.end(), [this](std::size_t a, std::size_t b) {
      const CenterlinePlace &x = stops_[a], &y = stops_[b];
      return x.curve != y.curve ? x.curve < y.curve : x.s_mm != y.s_mm ? x.s_mm < y.s_mm : a < b;
    });
    rank_.resize(stops_.size());
    for (std::size_t k = 0; k < order_.size(); ++k) rank_[order_[k]] = k;
  }

  static constexpr std::size_t kFrom = 0, kTo = 1;
  std::size_t size() const { return stops_.size() + stops_of_.size(); }
  bool IsStop(std::size_t node) const { return node < stops_.size(); }
  const CenterlinePlace& Stop(std::size_t node) const { return stops_[node]; }

  // Calls visit(neighbor, distance in mm).
  template <class Visit>
  void ForEachNeighbor(std::size_t node, const Visit& visit) const {
    if (!IsStop(node)) {
      for (const std::size_t stop : stops_of_[node - stops_.size()]) visit(stop, 0.0);
      return;
    }
    const auto along = [&](std::size_t rank) {
      const CenterlinePlace& there = stops_[order_[rank]];
      if (there.curve != stops_[node].curve) return;
      visit(order_[rank], std::abs(there.s_mm - stops_[node].s_mm));
    };
    if (rank_[node] > 0) along(rank_[node] - 1);
    if (rank_[node] + 1 < order_.size()) along(rank_[node] + 1);
    if (joint_of_[node] != kNone) visit(stops_.size() + joint_of_[node], 0.0);
  }

 private:
  std::vector<CenterlinePlace> stops_;
  std::vector<std::size_t> joint_of_;               // of each stop
  std::vector<std::vector<std::size_t>> stops_of_;  // of each joint
  std::vector<std::size_t> order_;                  // stops by curve, then by arc length
  std::vector<std::size_t> rank_;                   // of each stop in order_
};

// Legs between the nodes of a way: the stops between two joints lie on one curve.
std::vector<RouteLeg> LegsOf(const RouteGraph& graph, const std::vector<std::size_t>& way) {
  std::vector<RouteLeg> legs;
  bool on_leg = false;
  for (const std::size_t node : way) {
    if (!graph.IsStop(node)) {
      on_leg = false;
      continue;
    }
    const CenterlinePlace& stop = graph.Stop(node);
    if (!on_leg) legs.push_back({stop.curve, stop.s_mm, stop.s_mm});
    legs.back().to_mm = stop.s_mm;
    on_leg = true;
  }
  std::erase_if(
      legs, [](const RouteLeg& leg) { return std::abs(leg.from_mm - leg.to_mm) < kNoLengthMm; });
  return legs;
}

}  // namespace

Route FindRoute(const CenterlineNetwork& network, const CenterlinePlace& from,
                const CenterlinePlace& to) {
  const RouteGraph graph(network, from, to);
  Route route;
  std::vector<double> distance_mm(graph.size(), kFar);
  std::vector<std::size_t> previous(graph.size(), kNone);
  using Entry = std::pair<double, std::size_t>;
  std::priority_queue<Entry, std::vector<Entry>, std::greater<>> open;
  distance_mm[RouteGraph::kFrom] = 0;
  open.emplace(0, RouteGraph::kFrom);
  while (!open.empty() && open.top().second != RouteGraph::kTo) {
    const auto [here_mm, node] = open.top();
    open.pop();
    if (here_mm > distance_mm[node]) continue;  // settled earlier, by a shorter way
    graph.ForEachNeighbor(node, [&, here_mm = here_mm, node = node](std::size_t next, double mm) {
      ++route.steps;
      if (here_mm + mm >= distance_mm[next]) return;
      distance_mm[next] = here_mm + mm;
      previous[next] = node;
      open.emplace(distance_mm[next], next);
    });
  }
  route.connected = distance_mm[RouteGraph::kTo] < kFar;
  if (!route.connected) return route;
  route.length_mm = distance_mm[RouteGraph::kTo];
  std::vector<std::size_t> way{RouteGraph::kTo};
  while (way.back() != RouteGraph::kFrom) way.push_back(previous[way.back()]);
  std::reverse(way.begin(), way.end());
  route.legs = LegsOf(graph, way);
  return route;
}

}  // namespace torquer::vessel
