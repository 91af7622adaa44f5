// follow_wire prints the newest state of the innermost instrument ten times a second, one JSON
// object per line, until SIGTERM.
#include "tests/hil/guest/follow.h"
#include "torquer_lcm/wire_state_t.hpp"

int main() {
  torquer::test::Follow<torquer_lcm::wire_state_t>(
      torquer::protocol::kWireStateChannel, [](const torquer_lcm::wire_state_t& state) {
        if (state.instruments.empty()) return;
        const torquer_lcm::instrument_state_t& wire = state.instruments.front();
        std::printf(
            "{\"tick\":%lld,\"insertion_mm\":%.9f,\"rotation_rad\":%.9f,\"carried_mm\":%.9f,"
            "\"status\":%d,\"nodes\":%d,\"residual\":%.3g}\n",
            static_cast<long long>(state.tick), wire.insertion_mm, wire.rotation_rad,
            wire.carried_mm, state.status, state.node_count, state.residual);
      });
}
