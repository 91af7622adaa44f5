// follow_command prints the newest instrument command ten times a second, one JSON object per line,
// until SIGTERM.
#include "tests/hil/guest/follow.h"
#include "torquer_lcm/instrument_command_t.hpp"

int main() {
  torquer::test::Follow<torquer_lcm::instrument_command_t>(
      torquer::protocol::kInstrumentCommandChannel,
      [](const torquer_lcm::instrument_command_t& command) {
        std::printf(
            "{\"insertion_mm\":%.9f,\"rotation_rad\":%.9f,\"lao_rad\":%.9f,\"cra_rad\":%.9f,"
            "\"xray\":%d,\"contrast\":%d,\"flags\":%d}\n",
            command.insertion_mm, command.rotation_rad, command.lao_rad, command.cra_rad,
            command.xray, command.contrast, command.flags);
      });
}
