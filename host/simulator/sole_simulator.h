// A bus has one simulator: a second one is refused before it publishes anything.
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <torquer_lcm/wire_state_t.hpp>

#include "host/bus/bus.h"
#include "host/bus/claim.h"

namespace torquer::simulator {

/// The claim of a simulator on its bus, held until destruction.
class SoleSimulator {
 public:
  /// Throws UserError naming the process and the scene of the simulator that has the claim.
  SoleSimulator(const std::string& url, const std::string& scene);

  /// Waits until kListenUs after the construction. Throws UserError if wire states of another
  /// user's simulator, or of a log player, come until then.
  void Listen();

  /// Longer than the 200 ms after which a simulator repeats its state at the latest.
  static constexpr std::int64_t kListenUs = 300'000;

 private:
  std::optional<bus::Bus> listener_;  // until Listen() is done
  const bus::Claim claim_;
  std::int64_t began_us_;
  std::string heard_;  // sender, and instruments of its states
};

}  // namespace torquer::simulator
