// What the hands want, gathered from the bus.
#pragma once

#include <cstdint>
#include <optional>
#include <set>
#include <string>
#include <torquer_lcm/imaging_command_t.hpp>
#include <torquer_lcm/instrument_command_t.hpp>
#include <torquer_lcm/wire_state_t.hpp>
#include <vector>

#include "host/bus/health_reporter.h"
#include "host/bus/sender.h"
#include "host/simulator/simulation.h"

namespace torquer::simulator {

/// Takes instrument commands; the newest of each instrument counts. C-arm and pedals are those of
/// the innermost instrument's box. Of what is chosen on the X-ray system the newest stands, whoever
/// is silent.
///
/// An instrument, and the X-ray system, belongs to who commands it, until no usable command of that
/// sender has come for kOwnedUs: commands of others are refused, and numbers that go back. Then any
/// sender and any number is taken. No clock: the caller says what time it is, by
/// bus::MonotonicUs().
class LiveCommands {
 public:
  /// After so long without a command its instrument stays where the last one wanted it, its pedals
  /// are up, and the state is in doubt.
  static constexpr std::int64_t kSilentUs = 300'000;
  static constexpr std::int64_t kOwnedUs = 1'000'000;

  /// `simulation` must outlive this.
  explicit LiveCommands(const Simulation& simulation);

  void Take(const torquer_lcm::instrument_command_t& message, const bus::Sender& sender,
            std::int64_t now_us);
  void Take(const torquer_lcm::imaging_command_t& message, const bus::Sender& sender,
            std::int64_t now_us);
  /// Finds who has become silent. To be called several times in kSilentUs.
  void Age(std::int64_t now_us);

  const Command& command() const { return command_; }
  std::int64_t taken() const { return taken_; }
  /// Whether the command has changed since the last Settle.
  bool fresh() const { return fresh_; }
  /// The commands are in a state now.
  void Settle() { fresh_ = false; }
  /// When the newest command was published; 0 where that is unknown or another machine's clock.
  std::int64_t sent_us() const { return sent_us_; }
  /// Fills sequence and origin of each instrument.
  void Describe(torquer_lcm::wire_state_t& out) const;

  /// For health: "running", or whose commands are missing.
  std::string State() const;
  /// For health: what changed since this was asked last, and what was refused, in a sentence; ""
  /// for nothing. A refusal is named once a minute for each instrument and kind; the counters have
  /// all.
  std::string TakeNews();
  /// What was taken and refused.
  bus::HealthCounters Counters() const;

 private:
  enum Refusal { kValue, kSender, kOrder, kRefusals };
  struct Source {
    std::optional<bus::Sender> owner;  // none before the first command
    std::int64_t heard_us = 0;         // the last usable command of the owner
    std::int64_t sequence = -1;
    std::int64_t origin_us = 0;
    bool in_doubt = false;
    bool refused = false;
    bool silent = false;
    std::int64_t named_us[kRefusals] = {};  // 0: never
  };

  bool Owns(const Source& source, std::int64_t now_us) const;
  bool Accepts(Source& source, const std::string& what, std::int64_t sequence,
               const bus::Sender& sender, std::int64_t now_us);
  void Refuse(Source& source, Refusal kind, std::int64_t now_us, const std::string& what);
  void SayUnknown(const std::string& instrument, const bus::Sender& sender, std::int64_t now_us);
  void Say(const std::string& what);
  void Combine();

  const Simulation& simulation_;
  const InstrumentPlaces start_;
  const std::int64_t clock_id_;
  Command command_;
  std::vector<Source> sources_;
  Source imaging_;
  std::int64_t taken_ = 0;
  std::int64_t unknown_ = 0;
  std::set<std::string> unknown_named_;  // instruments, in this minute
  std::int64_t unknown_named_us_ = 0;
  std::int64_t refusals_[kRefusals] = {};
  std::int64_t sent_us_ = 0;
  bool fresh_ = false;
  std::string news_;
};

}  // namespace torquer::simulator
