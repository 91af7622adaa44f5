#include "host/simulator/effects/blood/contrast.h"

#include <algorithm>
#include <cmath>
#include <utility>

namespace torquer::effects {

namespace {

constexpr double kMm3PerML = 1e3;
constexpr double kLongestStepS = 5e-3;  // resolves the pulse
constexpr double kLargestCourant =
    0.9;  // fraction of a cell's contents given off in a step; 1 would empty it
constexpr double kSourceRenewalS = 0.02;  // interval between searches for an injecting tip
constexpr double kLeastFraction = 1e-12;  // of the injected dye; with less, an edge is cleared

// Van Leer's limited difference: second order where smooth, no new extremes.
double Limited(double behind, double ahead) {
  const double product = behind * ahead;
  return product > 0 ? 2 * product / (behind + ahead) : 0;
}

signed char Sign(double x) { return static_cast<signed char>((x > 0) - (x < 0)); }

}  // namespace

Contrast::Contrast(const Flow& flow, const ContrastSettings& settings, const WireModel& wire)
    : flow_(flow), settings_(settings), wire_(wire) {
  const FlowGraph& graph = flow.graph();
  std::size_t most = 0;
  for (const FlowEdge& edge : graph.edges()) {
    Cells cells;
    cells.first = volume_.size();
    cells.count = std::max<std::size_t>(
        2, static_cast<std::size_t>(std::ceil(edge.length_mm() / settings.cell_mm)));
    cells.length_mm = edge.length_mm() / static_cast<double>(cells.count);
    double least = 1e300;
    for (std::size_t i = 0; i < cells.count; ++i) {
      const double from = edge.from_mm + static_cast<double>(i) * cells.length_mm;
      volume_.push_back(graph.VolumeMm3(edge.curve, from, from + cells.length_mm));
      least = std::min(least, volume_.back());
    }
    const double per_area = settings.dispersion_mm2_s / (cells.length_mm * cells.length_mm);
    double fastest = 0;
    spread_mm3_s_.push_back(0);
    for (std::size_t i = 1; i < cells.count; ++i) {
      const double a = volume_[cells.first + i - 1];
      const double b = volume_[cells.first + i];
      spread_mm3_s_.push_back(per_area * std::min(a, b));
      fastest = std::max(fastest, 2 * per_area);
    }
    most = std::max(most, cells.count);
    edge_least_mm3_.push_back(least);
    edge_spread_1_s_.push_back(fastest);
    cells_.push_back(cells);
  }
  slope_.resize(most);
  flux_.resize(most + 1);
  if (settings.injector) injector_.emplace(*settings.injector);
  Restart();
}

// Finds the response of all flows to an inflow at each node.
void Contrast::TakeResponses() {
  responses_version_ = flow_.version();
  std::vector<double> inflow(flow_.graph().nodes().size(), 0);
  const std::vector<double> no_pressures(flow_.solution().ends().size(), 0);
  per_inflow_.resize(inflow.size());
  for (std::size_t n = 0; n < inflow.size(); ++n) {
    inflow[n] = 1;
    per_inflow_[n] = flow_.solution().Solve(inflow, no_pressures).edge_mL_s;
    inflow[n] = 0;
  }
}

void Contrast::CopyFrom(const Effect& twin) {
  const auto& from = dynamic_cast<const Contrast&>(twin);
  concentration_ = from.concentration_;
  edge_mass_mg_ = from.edge_mass_mg_;
  per_inflow_ = from.per_inflow_;
  responses_version_ = from.responses_version_;
  edge_mL_s_ = from.edge_mL_s_;
  source_ = from.source_;
  source_age_s_ = from.source_age_s_;
  flows_ = from.flows_;
  order_ = from.order_;
  signs_ = from.signs_;
  node_mass_mg_ = from.node_mass_mg_;
  node_out_mm3_s_ = from.node_out_mm3_s_;
  injector_ = from.injector_;
  injected_mg_ = from.injected_mg_;
  washed_out_mg_ = from.washed_out_mg_;
  clear_ = from.clear_;
}

void Contrast::Restart() {
  concentration_.assign(volume_.size(), 0);
  edge_mass_mg_.assign(cells_.size(), 0);
  node_mass_mg_.assign(flow_.graph().nodes().size(), 0);
  node_out_mm3_s_.assign(flow_.graph().nodes().size(), 0);
  flows_.assign(cells_.size(), {});
  signs_.assign(2 * cells_.size(), 2);
  order_.clear();
  source_ = {};
  source_age_s_ = 0;
  if (injector_) injector_->Restart();
  injected_mg_ = washed_out_mg_ = 0;
  clear_ = true;
  if (settings_.site == ContrastSettings::Site::kPlace) PlaceSource(settings_.place);
  if (settings_.site == ContrastSettings::Site::kEntry) {
    PlaceSource(flow_.graph().network().NearestTo(wire_.sheath().point_mm));
  }
}

void Contrast::PlaceSource(const vessel::CenterlinePlace& place) {
  const FlowGraph& graph = flow_.graph();
  source_.edge = graph.EdgeAt(place);
  const auto e = static_cast<std::size_t>(source_.edge);
  const FlowEdge& edge = graph.edges()[e];
  const double s = std::clamp(place.s_mm, edge.from_mm, edge.to_mm);
  source_.cell = std::min(cells_[e].count - 1,
                          static_cast<std::size_t>((s - edge.from_mm) / cells_[e].length_mm));
  source_.beyond = graph.InverseFourthPower(edge.curve, edge.from_mm, s) /
                   graph.InverseFourthPower(edge.curve, edge.from_mm, edge.to_mm);
}

double Contrast::inside_mg() const {
  double sum = 0;
  for (const double mass : edge_mass_mg_) sum += mass;
  for (const double mass : node_mass_mg_) sum += mass;
  return sum;
}

std::vector<Reading> Contrast::Readings() const {
  std::vector<Reading> readings = {
      {"contrast_injected_mL", injected_mg_ / settings_.concentration_mg_mL},
      {"contrast_inside_mg", inside_mg()},
      {"contrast_washed_out_mg", washed_out_mg_}};
  if (settings_.patient_limit_mL) {
    readings.push_back({"contrast_limit_mL", *settings_.patient_limit_mL});
  }
  if (injector_) {
    for (Reading& reading : injector_->Readings()) readings.push_back(std::move(reading));
  }
  return readings;
}

void Contrast::Advance(const TickView& tick) {
  if (injector_) injector_->Take(tick.controls.injector, tick.time_s - tick.step_s);
  const double insertion_mm = tick.state.poses()[settings_.instrument].insertion_mm;
  Advance(tick.time_s, tick.step_s, tick.controls.contrast,
          PointAt(wire_, tick.state.CurveOf(settings_.instrument), insertion_mm));
}

void Contrast::Advance(double time_s, double step_s, bool injecting,
                       const Eigen::Vector3d& tip_mm) {
  const bool is_fed = injecting || (injector_ && injector_->injecting());
  if (!(step_s > 0) || (clear_ && !is_fed)) return;
  if (is_fed && settings_.site == ContrastSettings::Site::kTip) {
    source_age_s_ += step_s;
    if (source_.edge < 0 || source_age_s_ >= kSourceRenewalS) {
      PlaceSource(flow_.graph().network().NearestTo(tip_mm));
      source_age_s_ = 0;
    }
  }
  const int steps = std::max(1, static_cast<int>(std::ceil(step_s / kLongestStepS)));
  for (int k = 0; k < steps; ++k) {
    Step(time_s - step_s * (1 - (k + 0.5) / steps), step_s / steps, injecting);
  }
}

void Contrast::FindFlows(double time_s, double injected_mL_s) {
  flow_.EdgesAt(time_s, edge_mL_s_);
  for (std::size_t e = 0; e < flows_.size(); ++e) {
    flows_[e].at_a = flows_[e].at_b = kMm3PerML * edge_mL_s_[e];
  }
  if (injected_mL_s > 0) {
    if (responses_version_ != flow_.version()) TakeResponses();
    // An inflow within an edge acts on the other edges like two at its ends, divided by resistance.
    const auto at = static_cast<std::size_t>(source_.edge);
    const FlowEdge& edge = flow_.graph().edges()[at];
    const double to_b = kMm3PerML * injected_mL_s * source_.beyond;
    const double to_a = kMm3PerML * injected_mL_s - to_b;
    const std::vector<double>& from_a = per_inflow_[static_cast<std::size_t>(edge.a)];
    const std::vector<double>& from_b = per_inflow_[static_cast<std::size_t>(edge.b)];
    for (std::size_t e = 0; e < flows_.size(); ++e) {
      const double more = to_a * from_a[e] + to_b * from_b[e];
      flows_[e].at_a += more;
      flows_[e].at_b += more;
    }
    flows_[at].at_a -= to_a;
    flows_[at].at_b += to_b;
  }
  bool same = true;
  for (std::size_t e = 0; e < flows_.size(); ++e) {
    const signed char a = Sign(flows_[e].at_a);
    const signed char b = Sign(flows_[e].at_b);
    same = same && signs_[2 * e] == a && signs_[2 * e + 1] == b;
    signs_[2 * e] = a;
    signs_[2 * e + 1] = b;
  }
  if (!same) OrderEdges();
}

int Contrast::UpstreamNode(std::size_t edge) const {
  if (flows_[edge].at_a > 0) return flow_.graph().edges()[edge].a;
  if (flows_[edge].at_b < 0) return flow_.graph().edges()[edge].b;
  return -1;
}

// Orders the edges: each comes after all that flow into its upstream node. Pressure falls along the
// flow, so such an order exists. If rounding prevented it, dye would only wait a step in a node.
void Contrast::OrderEdges() {
  const std::vector<FlowNode>& nodes = flow_.graph().nodes();
  const std::vector<FlowEdge>& edges = flow_.graph().edges();
  std::vector<int> waits(nodes.size(), 0);
  std::vector<bool> placed(edges.size(), false);
  const auto feeds = [this, &edges](std::size_t e, auto&& visit) {
    if (flows_[e].at_a < 0) visit(static_cast<std::size_t>(edges[e].a));
    if (flows_[e].at_b > 0) visit(static_cast<std::size_t>(edges[e].b));
  };
  for (std::size_t e = 0; e < edges.size(); ++e) {
    feeds(e, [&waits](std::size_t node) { ++waits[node]; });
  }
  order_.clear();
  bool forced = false;
  while (order_.size() < edges.size()) {
    const std::size_t before = order_.size();
    for (std::size_t e = 0; e < edges.size(); ++e) {
      const int from = UpstreamNode(e);
      if (placed[e] || (from >= 0 && waits[static_cast<std::size_t>(from)] > 0 && !forced))
        continue;
      placed[e] = true;
      order_.push_back(e);
      feeds(e, [&waits](std::size_t node) { --waits[node]; });
      forced = false;
    }
    forced = order_.size() == before;
  }
}

void Contrast::PourInto(int node, double mass_mg) {
  const auto n = static_cast<std::size_t>(node);
  if (flow_.graph().nodes()[n].is_end()) {
    washed_out_mg_ += mass_mg;
  } else {
    node_mass_mg_[n] += mass_mg;
  }
}

void Contrast::Step(double time_s, double step_s, bool injecting) {
  const double injected_mL_s =
      (injecting ? settings_.rate_mL_s : 0) + (injector_ ? injector_->Deliver(step_s) / step_s : 0);
  FindFlows(time_s, injected_mL_s);
  const std::vector<FlowEdge>& edges = flow_.graph().edges();
  std::fill(node_out_mm3_s_.begin(), node_out_mm3_s_.end(), 0);
  for (std::size_t e = 0; e < edges.size(); ++e) {
    node_out_mm3_s_[static_cast<std::size_t>(edges[e].a)] += std::max(0.0, flows_[e].at_a);
    node_out_mm3_s_[static_cast<std::size_t>(edges[e].b)] += std::max(0.0, -flows_[e].at_b);
  }
  injected_mg_ += settings_.concentration_mg_mL * injected_mL_s * step_s;
  clear_ = !(injected_mL_s > 0);
  for (const std::size_t e : order_) {
    // Each edge takes its fraction of the dye in its upstream node, so rounding loses no dye.
    const int from = UpstreamNode(e);
    double inflow_mg_mL = 0;
    if (from >= 0) {
      const auto n = static_cast<std::size_t>(from);
      const double flow_mm3_s = std::max(flows_[e].at_a, -flows_[e].at_b);
      if (node_mass_mg_[n] > 0) {
        const double fraction = std::min(1.0, flow_mm3_s / node_out_mm3_s_[n]);
        const double mass_mg = fraction * node_mass_mg_[n];
        inflow_mg_mL = kMm3PerML * mass_mg / (flow_mm3_s * step_s);
        node_mass_mg_[n] -= mass_mg;
      }
      node_out_mm3_s_[n] -= flow_mm3_s;
    }
    const double here_mL_s = static_cast<int>(e) == source_.edge ? injected_mL_s : 0;
    if (inflow_mg_mL > 0 || edge_mass_mg_[e] > 0 || here_mL_s > 0) {
      CarryAlong(e, step_s, inflow_mg_mL, here_mL_s);
    }
    clear_ = clear_ && edge_mass_mg_[e] == 0;
  }
}

void Contrast::CarryAlong(std::size_t e, double step_s, double inflow_mg_mL, double injected_mL_s) {
  const bool injects = injected_mL_s > 0;
  const std::size_t n = cells_[e].count;
  double* const c = &concentration_[cells_[e].first];
  const double* const volume = &volume_[cells_[e].first];
  const double* const spread = &spread_mm3_s_[cells_[e].first];
  const EndFlows flow = flows_[e];
  const std::size_t turn = injects ? source_.cell : n;  // faces beyond this one have the flow at b
  const double most_mm3_s = std::max(std::abs(flow.at_a), std::abs(flow.at_b));
  // A cell with a source can give off to both sides.
  const double given_1_s =
      (injects ? 2 : 1) * most_mm3_s / edge_least_mm3_[e] + edge_spread_1_s_[e];
  const int steps = std::max(1, static_cast<int>(std::ceil(step_s * given_1_s / kLargestCourant)));
  const double dt = step_s / steps;
  const double in_a = flow.at_a > 0 ? inflow_mg_mL : 0;
  const double in_b = flow.at_b < 0 ? inflow_mg_mL : 0;
  double out_a = 0;
  double out_b = 0;
  for (int step = 0; step < steps; ++step) {
    slope_[0] = Limited(flow.at_a > 0 ? c[0] - in_a : 0, c[1] - c[0]);
    for (std::size_t i = 1; i + 1 < n; ++i) slope_[i] = Limited(c[i] - c[i - 1], c[i + 1] - c[i]);
    slope_[n - 1] = Limited(c[n - 1] - c[n - 2], flow.at_b < 0 ? in_b - c[n - 1] : 0);
    // The mean concentration at a face over the step is the value half a step's flow upstream.
    flux_[0] = flow.at_a * (flow.at_a > 0 ? in_a : c[0]);
    const auto faces = [&](std::size_t from, std::size_t to, double q) {
      if (q > 0) {
        for (std::size_t i = from; i < to; ++i) {
          const double face = c[i - 1] + 0.5 * (1 - q * dt / volume[i - 1]) * slope_[i - 1];
          flux_[i] = q * face - spread[i] * (c[i] - c[i - 1]);
        }
      } else {
        for (std::size_t i = from; i < to; ++i) {
          const double face = c[i] - 0.5 * (1 + q * dt / volume[i]) * slope_[i];
          flux_[i] = q * face - spread[i] * (c[i] - c[i - 1]);
        }
      }
    };
    faces(1, std::min(turn + 1, n), flow.at_a);
    faces(std::min(turn + 1, n), n, flow.at_b);
    flux_[n] = flow.at_b * (flow.at_b > 0 ? c[n - 1] : in_b);
    for (std::size_t i = 0; i < n; ++i) c[i] += dt * (flux_[i] - flux_[i + 1]) / volume[i];
    if (injects) {
      c[turn] += dt * kMm3PerML * injected_mL_s * settings_.concentration_mg_mL / volume[turn];
    }
    if (flow.at_a < 0) out_a -= dt * flux_[0];
    if (flow.at_b > 0) out_b += dt * flux_[n];
  }
  if (out_a > 0) PourInto(flow_.graph().edges()[e].a, out_a / kMm3PerML);
  if (out_b > 0) PourInto(flow_.graph().edges()[e].b, out_b / kMm3PerML);
  double mass = 0;
  for (std::size_t i = 0; i < n; ++i) mass += c[i] * volume[i];
  edge_mass_mg_[e] = mass / kMm3PerML;
  if (edge_mass_mg_[e] < kLeastFraction * injected_mg_ && !injects) {
    washed_out_mg_ += edge_mass_mg_[e];
    edge_mass_mg_[e] = 0;
    std::fill(c, c + n, 0.0);
  }
}

}  // namespace torquer::effects
