// Message of a simulation's state.
#include <algorithm>

#include "host/simulator/simulation.h"

namespace torquer::simulator {

namespace {

// Position in a message.
std::vector<float> Rounded(const Eigen::Vector3d& x) {
  return {static_cast<float>(x[0]), static_cast<float>(x[1]), static_cast<float>(x[2])};
}

}  // namespace

void Simulation::Describe(torquer_lcm::wire_state_t& out) const {
  out.tick = tick_;
  out.time_s = time_s_;
  out.energy_mJ = report_.energy_mJ;
  out.residual = report_.residual;
  out.max_penetration_um = 1e3 * report_.max_penetration_mm;
  out.actions = report_.actions;
  out.work = report_.work;
  out.updates = updates_;
  out.state_hash = static_cast<std::int64_t>(hash_);
  out.status = status_;
  DescribeInstruments(out);
  DescribeShape(out);
  DescribeContacts(out);
  DescribePast(out);
}

void Simulation::DescribeInstruments(torquer_lcm::wire_state_t& out) const {
  const InstrumentPoses& poses = state_.poses();
  const InstrumentPoses start = scene_.start();
  out.instruments.resize(static_cast<std::size_t>(poses.size()));
  out.instrument_count = poses.size();
  for (int k = 0; k < poses.size(); ++k) {
    const auto at = static_cast<std::size_t>(k);
    const Curve& curve = state_.CurveOf(k);
    torquer_lcm::instrument_state_t& instrument = out.instruments[at];
    instrument.name = scene_.instruments()[at].name;
    instrument.inserted_at_start_mm = start[k].insertion_mm;
    instrument.commanded_insertion_mm = target_[k].insertion_mm;
    instrument.commanded_rotation_rad = target_[k].rotation_rad;
    instrument.insertion_mm = poses[k].insertion_mm;
    instrument.rotation_rad = poses[k].rotation_rad;
    // With less than half a segment inside there is no segment yet, and the whole insertion is
    // carried.
    instrument.carried_mm =
        target_[k].insertion_mm - (curve.segments() > 0 ? poses[k].insertion_mm : 0);
    instrument.carried_rad = target_[k].rotation_rad - poses[k].rotation_rad;
    const Eigen::Vector3d tip = PointAt(scene_.stack().instrument(k), curve, poses[k].insertion_mm);
    for (int axis = 0; axis < 3; ++axis) instrument.tip_mm[axis] = tip[axis];
    DescribeOwnNodes(k, instrument);
  }
}

// Nodes of an instrument that does not lie on curve 0.
void Simulation::DescribeOwnNodes(int k, torquer_lcm::instrument_state_t& out) const {
  out.nodes_mm.clear();
  const Curve& curve = state_.CurveOf(k);
  if (&curve != &state_.curve(0)) {
    const double insertion_mm = state_.poses()[k].insertion_mm;
    const int n = NodesBefore(scene_.stack().instrument(k), curve, insertion_mm);
    const int stride = n / kMostOwnNodesInMessage + 1;
    for (int i = 0; i < n; i += stride) {
      out.nodes_mm.push_back(Rounded(curve.nodes()[static_cast<std::size_t>(i)]));
    }
    out.nodes_mm.push_back(Rounded(PointAt(scene_.stack().instrument(k), curve, insertion_mm)));
  }
  out.node_count = static_cast<std::int32_t>(out.nodes_mm.size());
}

void Simulation::DescribeShape(torquer_lcm::wire_state_t& out) const {
  const std::vector<Eigen::Vector3d>& nodes = state_.nodes();
  const int n = state_.segments();
  out.segment_count = n;
  out.stride = n / kMostNodesInMessage + 1;
  out.nodes_mm.clear();
  for (int i = 0; i < n; i += out.stride) {
    out.nodes_mm.push_back(Rounded(nodes[static_cast<std::size_t>(i)]));
  }
  out.nodes_mm.push_back(Rounded(nodes.back()));
  out.node_count = static_cast<std::int32_t>(out.nodes_mm.size());
}

void Simulation::VisitContacts(
    int curve, const std::function<void(int node, double penetration_mm)>& visit) const {
  const PointSet& points = relaxation_->Current().curve(curve).points;
  for (int i = 0; i < state_.curve(curve).segments(); ++i) {
    double deepest_mm = 0;
    for (int k = 0; k < points.per_segment; ++k) {
      const auto q = static_cast<std::size_t>(i * points.per_segment + k);
      if (q >= points.touches.size() || !points.touches[q]) continue;
      deepest_mm = std::max(deepest_mm, points.radius_mm[q] - points.clearance[q].clearance_mm);
    }
    if (deepest_mm > 0) visit(i + 1, deepest_mm);
  }
}

void Simulation::DescribeContacts(torquer_lcm::wire_state_t& out) const {
  out.contact_nodes.clear();
  out.contact_penetrations_um.clear();
  VisitContacts(0, [&out](int node, double penetration_mm) {
    out.contact_nodes.push_back(node);
    out.contact_penetrations_um.push_back(static_cast<float>(1e3 * penetration_mm));
  });
  out.contact_count = static_cast<std::int32_t>(out.contact_nodes.size());
}

void Simulation::DescribePast(torquer_lcm::wire_state_t& out) const {
  const std::size_t past = done_.empty() ? 0 : done_.size() - 1;
  out.past_count = static_cast<std::int32_t>(past);
  out.past_time_s.resize(past);
  out.past_work.resize(past);
  out.past_insertion_mm.resize(past);
  out.past_rotation_rad.resize(past);
  for (std::size_t k = 0; k < past; ++k) {
    const Done& done = done_[k + 1];
    out.past_time_s[k] = done.time_s;
    out.past_work[k] = done.work;
    out.past_insertion_mm[k].clear();
    out.past_rotation_rad[k].clear();
    for (const InstrumentPose& pose : done.target) {
      out.past_insertion_mm[k].push_back(pose.insertion_mm);
      out.past_rotation_rad[k].push_back(pose.rotation_rad);
    }
  }
}

}  // namespace torquer::simulator
