#include "host/simulator/core/wire_state.h"

#include "host/simulator/core/hash.h"

namespace torquer {

WireState WireState::Along(const WireModel& model, const std::vector<Eigen::Vector3d>& path_mm,
                           const InstrumentPoses& poses) {
  WireState state(model, poses.size());
  state.LayAlong(model, path_mm, poses, poses.reach_mm());
  return state;
}

std::uint64_t HashState(const WireState& state) {
  std::uint64_t hash = HashCurve(state);
  for (int c = 1; c < state.curves(); ++c) hash = HashWord(HashCurve(state.curve(c)), hash);
  return hash;
}

}  // namespace torquer
