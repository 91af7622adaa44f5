// What the hands want, gathered from the bus.
#pragma once

#include <cstdint>
#include <torquer_lcm/instrument_command_t.hpp>
#include <torquer_lcm/wire_state_t.hpp>
#include <vector>

#include "host/simulator/simulation.h"

namespace torquer::simulator {

/// Takes instrument commands; the newest of each instrument counts. C-arm and pedals are those of
/// the innermost instrument's box.
class LiveCommands {
 public:
  /// `simulation` must outlive this.
  explicit LiveCommands(const Simulation& simulation);

  void Take(const torquer_lcm::instrument_command_t& message);

  const Command& command() const { return command_; }
  std::int64_t taken() const { return taken_; }
  /// For an instrument that the scene does not have.
  std::int64_t unknown() const { return unknown_; }
  /// Whether a command came since the last Settle.
  bool fresh() const { return fresh_; }
  /// The commands are in a state now.
  void Settle() { fresh_ = false; }
  /// When the newest command was published; 0 where that is unknown or another machine's clock.
  std::int64_t sent_us() const { return sent_us_; }
  /// Fills sequence and origin of each instrument.
  void Describe(torquer_lcm::wire_state_t& out) const;

 private:
  struct Source {
    std::int64_t sequence = -1;
    std::int64_t origin_us = 0;
    bool in_doubt = false;
  };

  const Simulation& simulation_;
  const InstrumentPlaces start_;
  const std::int64_t clock_id_;
  Command command_;
  std::vector<Source> sources_;
  std::int64_t taken_ = 0;
  std::int64_t unknown_ = 0;
  std::int64_t sent_us_ = 0;
  bool fresh_ = false;
};

}  // namespace torquer::simulator
