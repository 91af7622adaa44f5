#include "host/simulator/effects/blood/flow_graph.h"

#include <Eigen/LU>
#include <algorithm>
#include <cassert>
#include <cmath>
#include <numbers>
#include <sstream>

#include "host/support/error.h"

namespace torquer::effects {

using vessel::Centerline;
using vessel::CenterlineNetwork;
using vessel::CenterlinePlace;

namespace {

// Places of joints on one curve that are closer than this count as one place.
constexpr double kSamePlaceMm = 1e-3;

struct Stop {
  double s_mm;
  int node;
};

// Calls piece(length, radius at its begin, at its end) for each stretch of linear radius.
template <class Piece>
void ForEachPiece(const Centerline& curve, double from_mm, double to_mm, const Piece& piece) {
  const std::vector<double>& arc = curve.arc_lengths_mm();
  const std::vector<double>& radius = curve.radii_mm();
  const auto radius_at = [&](std::size_t i, double s) {
    return radius[i] + (s - arc[i]) / (arc[i + 1] - arc[i]) * (radius[i + 1] - radius[i]);
  };
  for (std::size_t i = 0; i + 1 < arc.size(); ++i) {
    const double from = std::max(from_mm, arc[i]);
    const double to = std::min(to_mm, arc[i + 1]);
    if (to > from) piece(to - from, radius_at(i, from), radius_at(i, to));
  }
}

void CheckRadii(const Centerline& curve) {
  for (std::size_t i = 0; i < curve.radii_mm().size(); ++i) {
    if (curve.radii_mm()[i] > 0) continue;
    std::ostringstream text;
    text << "centerline \"" << curve.name() << "\" has radius 0 at " << curve.arc_lengths_mm()[i]
         << " mm; flow needs a radius above 0 everywhere: save the curve with its radii";
    throw UserError(text.str());
  }
}

}  // namespace

FlowGraph::FlowGraph(const CenterlineNetwork& network) : network_(&network) {
  std::vector<std::vector<Stop>> stops(network.curves().size());
  const auto add_node = [&](const Eigen::Vector3d& position, const CenterlinePlace& place) {
    nodes_.push_back({position, {}, place});
    return static_cast<int>(nodes_.size()) - 1;
  };
  for (const CenterlineNetwork::Joint& joint : network.joints()) {
    const int node = add_node(joint.position_mm, joint.places.front());
    for (const CenterlinePlace& place : joint.places) {
      stops[place.curve].push_back({place.s_mm, node});
    }
  }
  // Joints that share a place are merged: two ends may meet a third curve at the same point.
  std::vector<int> same(nodes_.size());
  for (std::size_t i = 0; i < same.size(); ++i) same[i] = static_cast<int>(i);
  const auto root = [&same](int node) {
    while (same[static_cast<std::size_t>(node)] != node)
      node = same[static_cast<std::size_t>(node)];
    return node;
  };
  for (std::vector<Stop>& list : stops) {
    std::sort(list.begin(), list.end(),
              [](const Stop& x, const Stop& y) { return x.s_mm < y.s_mm; });
    for (std::size_t i = 1; i < list.size(); ++i) {
      if (list[i].s_mm - list[i - 1].s_mm < kSamePlaceMm) {
        same[static_cast<std::size_t>(root(list[i].node))] = root(list[i - 1].node);
      }
    }
  }
  for (std::size_t c = 0; c < stops.size(); ++c) {
    const Centerline& curve = network.curves()[c];
    CheckRadii(curve);
    std::vector<Stop>& list = stops[c];
    if (list.empty() || list.front().s_mm > kSamePlaceMm) {
      list.insert(list.begin(), {0, add_node(curve.At(0).position_mm, {c, 0})});
      same.push_back(static_cast<int>(nodes_.size()) - 1);
    }
    if (list.back().s_mm < curve.length_mm() - kSamePlaceMm) {
      const double s = curve.length_mm();
      list.push_back({s, add_node(curve.At(s).position_mm, {c, s})});
      same.push_back(static_cast<int>(nodes_.size()) - 1);
    }
    for (std::size_t i = 1; i < list.size(); ++i) {
      const int a = root(list[i - 1].node);
      const int b = root(list[i].node);
      if (a != b) edges_.push_back({c, list[i - 1].s_mm, list[i].s_mm, a, b});
    }
  }
  // Only roots become nodes.
  std::vector<int> number(nodes_.size(), -1);
  std::vector<FlowNode> kept;
  for (std::size_t i = 0; i < nodes_.size(); ++i) {
    if (root(static_cast<int>(i)) != static_cast<int>(i)) continue;
    number[i] = static_cast<int>(kept.size());
    kept.push_back(nodes_[i]);
  }
  nodes_ = std::move(kept);
  for (std::size_t e = 0; e < edges_.size(); ++e) {
    FlowEdge& edge = edges_[e];
    edge.a = number[static_cast<std::size_t>(edge.a)];
    edge.b = number[static_cast<std::size_t>(edge.b)];
    nodes_[static_cast<std::size_t>(edge.a)].edges.push_back(static_cast<int>(e));
    nodes_[static_cast<std::size_t>(edge.b)].edges.push_back(static_cast<int>(e));
  }
}

int FlowGraph::NodeAt(const std::string& curve, const std::string& end) const {
  const CenterlinePlace place = network_->Place(curve, end);
  for (const FlowEdge& edge : edges_) {
    if (edge.curve != place.curve) continue;
    if (end == "start" && edge.from_mm < kSamePlaceMm) return edge.a;
    if (end == "end" && edge.to_mm > place.s_mm - kSamePlaceMm) return edge.b;
  }
  throw UserError("centerline \"" + curve +
                  "\" coincides with another centerline at this end; name the other one");
}

int FlowGraph::EdgeAt(const CenterlinePlace& place) const {
  for (std::size_t e = 0; e < edges_.size(); ++e) {
    if (edges_[e].curve == place.curve && place.s_mm <= edges_[e].to_mm) return static_cast<int>(e);
  }
  for (std::size_t e = edges_.size(); e-- > 0;) {
    if (edges_[e].curve == place.curve) return static_cast<int>(e);
  }
  throw UserError("centerline \"" + network_->curves()[place.curve].name() +
                  "\" coincides with other centerlines over its whole length; name one of them");
}

std::string FlowGraph::NameOf(int node) const {
  const CenterlinePlace& place = nodes_[static_cast<std::size_t>(node)].place;
  const Centerline& curve = network_->curves()[place.curve];
  if (place.s_mm <= kSamePlaceMm) return "\"" + curve.name() + "\" start";
  if (place.s_mm >= curve.length_mm() - kSamePlaceMm) return "\"" + curve.name() + "\" end";
  std::ostringstream text;
  text << "\"" << curve.name() << "\" at " << place.s_mm << " mm";
  return text.str();
}

std::vector<bool> FlowGraph::ReachedFrom(int node, int closed) const {
  std::vector<bool> reached(nodes_.size(), false);
  std::vector<int> open{node};
  reached[static_cast<std::size_t>(node)] = true;
  while (!open.empty()) {
    const int here = open.back();
    open.pop_back();
    for (const int e : nodes_[static_cast<std::size_t>(here)].edges) {
      if (e == closed) continue;
      const FlowEdge& edge = edges_[static_cast<std::size_t>(e)];
      const auto there = edge.a == here ? edge.b : edge.a;
      if (reached[static_cast<std::size_t>(there)]) continue;
      reached[static_cast<std::size_t>(there)] = true;
      open.push_back(there);
    }
  }
  return reached;
}

std::vector<int> FlowGraph::Parts() const {
  std::vector<int> parts(nodes_.size(), -1);
  int count = 0;
  for (std::size_t n = 0; n < nodes_.size(); ++n) {
    if (parts[n] >= 0) continue;
    const std::vector<bool> reached = ReachedFrom(static_cast<int>(n));
    for (std::size_t k = 0; k < nodes_.size(); ++k) {
      if (reached[k]) parts[k] = count;
    }
    ++count;
  }
  return parts;
}

double FlowGraph::InverseFourthPower(std::size_t curve, double from_mm, double to_mm) const {
  double sum = 0;
  ForEachPiece(network_->curves()[curve], from_mm, to_mm,
               [&sum](double length, double p, double q) {
                 sum += length * (p * p + p * q + q * q) / (3 * p * p * p * q * q * q);
               });
  return sum;
}

double FlowGraph::VolumeMm3(std::size_t curve, double from_mm, double to_mm) const {
  double sum = 0;
  ForEachPiece(network_->curves()[curve], from_mm, to_mm,
               [&sum](double length, double p, double q) {
                 sum += std::numbers::pi * length * (p * p + p * q + q * q) / 3;
               });
  return sum;
}

FlowSolution::FlowSolution(const FlowGraph& graph, std::vector<double> resistance_mmHg_s_mL,
                           std::vector<FlowEnd> ends)
    : graph_(graph), resistance_(std::move(resistance_mmHg_s_mL)), ends_(std::move(ends)) {
  assert(resistance_.size() == graph_.edges().size());
  unknown_.assign(graph_.nodes().size(), 0);
  for (const FlowEnd& end : ends_) {
    if (end.is_pressure) unknown_[static_cast<std::size_t>(end.node)] = -1;
  }
  int count = 0;
  for (int& index : unknown_) {
    if (index >= 0) index = count++;
  }
  Eigen::MatrixXd conductance = Eigen::MatrixXd::Zero(count, count);
  for (std::size_t e = 0; e < resistance_.size(); ++e) {
    const int a = unknown_[static_cast<std::size_t>(graph_.edges()[e].a)];
    const int b = unknown_[static_cast<std::size_t>(graph_.edges()[e].b)];
    const double g = 1 / resistance_[e];
    if (a >= 0) conductance(a, a) += g;
    if (b >= 0) conductance(b, b) += g;
    if (a >= 0 && b >= 0) {
      conductance(a, b) -= g;
      conductance(b, a) -= g;
    }
  }
  for (const FlowEnd& end : ends_) {
    if (end.is_pressure) continue;
    const int k = unknown_[static_cast<std::size_t>(end.node)];
    conductance(k, k) += 1 / (end.resistance_mmHg_s_mL + end.proximal_mmHg_s_mL);
  }
  inverse_ = conductance.partialPivLu().inverse();
}

FlowSolution::Flows FlowSolution::Solve(const std::vector<double>& inflow_mL_s,
                                        const std::vector<double>& end_pressure_mmHg) const {
  const std::vector<FlowEdge>& edges = graph_.edges();
  Flows flows;
  flows.pressure_mmHg.assign(graph_.nodes().size(), 0);
  flows.edge_mL_s.assign(edges.size(), 0);
  flows.end_mL_s.assign(ends_.size(), 0);
  // The given pressures come first; each round then corrects the remaining imbalance of the nodes.
  // Wide vessels have hardly any resistance, so flows from pressure differences alone would lose
  // digits. Sums of ever smaller corrections do not.
  std::vector<double> step(graph_.nodes().size(), 0);
  for (std::size_t k = 0; k < ends_.size(); ++k) {
    if (ends_[k].is_pressure) step[static_cast<std::size_t>(ends_[k].node)] = end_pressure_mmHg[k];
  }
  constexpr int kRounds = 4;
  for (int round = 0; round <= kRounds; ++round) {
    for (std::size_t e = 0; e < edges.size(); ++e) {
      flows.edge_mL_s[e] += (step[static_cast<std::size_t>(edges[e].a)] -
                             step[static_cast<std::size_t>(edges[e].b)]) /
                            resistance_[e];
    }
    for (std::size_t k = 0; k < ends_.size(); ++k) {
      if (ends_[k].is_pressure) continue;
      const double behind = round == 0 ? end_pressure_mmHg[k] : 0;
      flows.end_mL_s[k] += (step[static_cast<std::size_t>(ends_[k].node)] - behind) /
                           (ends_[k].resistance_mmHg_s_mL + ends_[k].proximal_mmHg_s_mL);
    }
    for (std::size_t n = 0; n < step.size(); ++n) flows.pressure_mmHg[n] += step[n];
    if (round == kRounds) break;
    std::vector<double> missing = inflow_mL_s;
    for (std::size_t e = 0; e < edges.size(); ++e) {
      missing[static_cast<std::size_t>(edges[e].a)] -= flows.edge_mL_s[e];
      missing[static_cast<std::size_t>(edges[e].b)] += flows.edge_mL_s[e];
    }
    for (std::size_t k = 0; k < ends_.size(); ++k) {
      if (!ends_[k].is_pressure)
        missing[static_cast<std::size_t>(ends_[k].node)] -= flows.end_mL_s[k];
    }
    Eigen::VectorXd right(inverse_.rows());
    for (std::size_t n = 0; n < unknown_.size(); ++n) {
      if (unknown_[n] >= 0) right[unknown_[n]] = missing[n];
    }
    const Eigen::VectorXd change = inverse_ * right;
    for (std::size_t n = 0; n < unknown_.size(); ++n) {
      step[n] = unknown_[n] >= 0 ? change[unknown_[n]] : 0;
    }
  }
  // At an end with a given pressure, the outflow is the sum of the inflows to its node.
  for (std::size_t k = 0; k < ends_.size(); ++k) {
    if (!ends_[k].is_pressure) continue;
    const int node = ends_[k].node;
    double out = inflow_mL_s[static_cast<std::size_t>(node)];
    for (const int e : graph_.nodes()[static_cast<std::size_t>(node)].edges) {
      const double flow = flows.edge_mL_s[static_cast<std::size_t>(e)];
      out += edges[static_cast<std::size_t>(e)].b == node ? flow : -flow;
    }
    flows.end_mL_s[k] = out;
  }
  return flows;
}

}  // namespace torquer::effects
