// Outlines: wire states without their shape. A log stores them between the ticks whose shapes it
// keeps.
#pragma once

#include "torquer_lcm/wire_state_t.hpp"

namespace torquer::bus {

/// True if a state contains only the two end nodes of a curve that has more. An outline has no
/// contacts either.
inline bool IsOutline(const torquer_lcm::wire_state_t& state) {
  return state.segment_count > 1 && state.node_count == 2 && state.stride >= state.segment_count;
}

/// Reduces each curve to its two end nodes, with `stride` set to match, and removes the contacts.
/// All other fields stay, and the state remains a valid message.
inline void ReduceToOutline(torquer_lcm::wire_state_t& state) {
  if (state.segment_count <= 1 || state.nodes_mm.size() <= 2) return;
  state.nodes_mm = {state.nodes_mm.front(), state.nodes_mm.back()};
  state.node_count = 2;
  state.stride = state.segment_count;
  for (torquer_lcm::instrument_state_t& instrument : state.instruments) {
    if (instrument.nodes_mm.size() <= 2) continue;
    instrument.nodes_mm = {instrument.nodes_mm.front(), instrument.nodes_mm.back()};
    instrument.node_count = 2;
  }
  state.contact_count = 0;
  state.contact_nodes.clear();
  state.contact_penetrations_um.clear();
}

/// Removes the state's data about earlier ticks.
inline void DropPast(torquer_lcm::wire_state_t& state) {
  state.past_count = 0;
  state.past_time_s.clear();
  state.past_work.clear();
  state.past_insertion_mm.clear();
  state.past_rotation_rad.clear();
}

}  // namespace torquer::bus
