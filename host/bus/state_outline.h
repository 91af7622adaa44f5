// Wire states without their shape, as logs have them between the ticks whose shapes are kept.
#pragma once

#include "torquer_lcm/wire_state_t.hpp"

namespace torquer::bus {

/// Whether of a curve with more nodes a state has the two ends alone. Its contacts are not in it
/// either.
inline bool IsOutline(const torquer_lcm::wire_state_t& state) {
  return state.segment_count > 1 && state.node_count == 2 && state.stride >= state.segment_count;
}

/// Leaves of the shape what makes the state an outline: by the meaning of `stride`, its ends. All
/// else stays, and it is a message like any other.
inline void ReduceToOutline(torquer_lcm::wire_state_t& state) {
  if (state.segment_count <= 1 || state.nodes_mm.size() <= 2) return;
  state.nodes_mm = {state.nodes_mm.front(), state.nodes_mm.back()};
  state.node_count = 2;
  state.stride = state.segment_count;
  state.contact_count = 0;
  state.contact_nodes.clear();
  state.contact_penetrations_um.clear();
}

/// Leaves out what the state says of earlier ticks.
inline void DropPast(torquer_lcm::wire_state_t& state) {
  state.past_count = 0;
  state.past_time_s.clear();
  state.past_work.clear();
  state.past_insertion_mm.clear();
  state.past_rotation_rad.clear();
}

}  // namespace torquer::bus
