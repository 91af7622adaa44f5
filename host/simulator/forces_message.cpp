#include "host/simulator/forces_message.h"

#include <algorithm>

#include "host/bus/clock.h"

namespace torquer::simulator {

namespace {

// Every stride-th value and the last one, converted from N to mN.
std::vector<float> Strided(const std::vector<double>& values, std::size_t stride) {
  std::vector<float> strided;
  for (std::size_t i = 0; i + 1 < values.size(); i += stride) {
    strided.push_back(static_cast<float>(1e3 * values[i]));
  }
  if (!values.empty()) strided.push_back(static_cast<float>(1e3 * values.back()));
  return strided;
}

// Every stride-th node and the last one, mN. Each has the forces of the skipped nodes before it,
// too.
std::vector<std::vector<float>> StridedSums(const std::vector<Eigen::Vector3d>& forces_N,
                                            std::size_t stride) {
  std::vector<std::vector<float>> sums;
  Eigen::Vector3d sum_mN = Eigen::Vector3d::Zero();
  for (std::size_t i = 0; i < forces_N.size(); ++i) {
    sum_mN += 1e3 * forces_N[i];
    if (i % stride != 0 && i + 1 != forces_N.size()) continue;
    sums.push_back({static_cast<float>(sum_mN[0]), static_cast<float>(sum_mN[1]),
                    static_cast<float>(sum_mN[2])});
    sum_mN.setZero();
  }
  return sums;
}

}  // namespace

void DescribeForces(const Simulation& simulation, torquer_lcm::wire_forces_t& out) {
  const InternalForces& forces = *simulation.forces();
  out.tick = simulation.tick();
  out.time_s = simulation.time_s();
  out.clock_id = bus::ClockId();
  out.names.clear();
  out.hand_force_mN.clear();
  out.hand_torque_mN_mm.clear();
  const std::vector<effects::Instrument>& instruments = simulation.scene().instruments();
  for (std::size_t k = 0; k < instruments.size(); ++k) {
    const HandForce& hand = (*simulation.hands())[k];
    out.names.push_back(instruments[k].name);
    out.hand_force_mN.push_back(1e3 * hand.axial_N);
    out.hand_torque_mN_mm.push_back(1e3 * hand.torque_mJ);
  }
  out.instrument_count = static_cast<std::int32_t>(out.names.size());
  const int n = simulation.state().Farthest().segments();
  out.stride = n / kMostNodesInForces + 1;
  const auto stride = static_cast<std::size_t>(out.stride);
  out.contact_force_mN = StridedSums(forces.contact_N, stride);
  out.line_load_mN_mm = Strided(forces.line_load_N_mm, stride);
  out.tension_mN = Strided(forces.tension_N, stride);
  out.bending_mN_mm = Strided(forces.bending_mJ, stride);
  out.twisting_mN_mm = Strided(forces.twisting_mJ, stride);
  out.node_count = static_cast<std::int32_t>(out.tension_mN.size());
}

}  // namespace torquer::simulator
