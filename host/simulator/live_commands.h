// Collects the commands of the hands from the bus.
#pragma once

#include <cstdint>
#include <optional>
#include <set>
#include <string>
#include <torquer_lcm/exchange_command_t.hpp>
#include <torquer_lcm/imaging_command_t.hpp>
#include <torquer_lcm/injector_command_t.hpp>
#include <torquer_lcm/instrument_command_t.hpp>
#include <torquer_lcm/table_command_t.hpp>
#include <torquer_lcm/wedge_command_t.hpp>
#include <torquer_lcm/wire_state_t.hpp>
#include <utility>
#include <vector>

#include "host/bus/health_reporter.h"
#include "host/bus/sender.h"
#include "host/simulator/simulation.h"

namespace torquer::simulator {

/// Order to exchange an instrument.
struct ExchangeOrder {
  int instrument = 0;
  std::string device;
};

/// Takes instrument commands; the newest one of each instrument is valid. The box of the innermost
/// instrument sets C-arm, pedals and table. The newest settings of the X-ray system stay valid when
/// their sender is silent. So does the newest position of the table. The power injector is disarmed
/// then, and stops.
///
/// Each instrument, the X-ray system, its wedges, the table, the power injector and the exchanges
/// have one sender of commands. Ownership ends when no usable command of this sender has come for
/// kOwnedUs. Until then commands of other senders and decreasing numbers are refused. Afterwards
/// any sender and any number from 0 on is accepted. The class has no clock: the caller passes the
/// time by bus::MonotonicUs().
class LiveCommands {
 public:
  /// After this time without a command the instrument is held at its last target. Its pedals are
  /// up, and the state is in doubt.
  static constexpr std::int64_t kSilentUs = 300'000;
  static constexpr std::int64_t kOwnedUs = 1'000'000;

  /// `scene` is simulated from its start, and must outlive this. An exchange of instruments does
  /// not change their names and starts.
  explicit LiveCommands(const scene::Scene& scene);

  void Take(const torquer_lcm::instrument_command_t& message, const bus::Sender& sender,
            std::int64_t now_us);
  void Take(const torquer_lcm::imaging_command_t& message, const bus::Sender& sender,
            std::int64_t now_us);
  void Take(const torquer_lcm::wedge_command_t& message, const bus::Sender& sender,
            std::int64_t now_us);
  void Take(const torquer_lcm::table_command_t& message, const bus::Sender& sender,
            std::int64_t now_us);
  void Take(const torquer_lcm::injector_command_t& message, const bus::Sender& sender,
            std::int64_t now_us);
  void Take(const torquer_lcm::exchange_command_t& message, const bus::Sender& sender,
            std::int64_t now_us);
  /// Detects senders that have become silent. Call it several times in kSilentUs.
  void Age(std::int64_t now_us);

  const Command& command() const { return command_; }
  std::int64_t taken() const { return taken_; }
  /// True if the command has changed since the last Settle.
  bool fresh() const { return fresh_; }
  /// Marks the commands as contained in a state.
  void Settle() { fresh_ = false; }
  /// Newest order to exchange an instrument, since the last call.
  std::optional<ExchangeOrder> TakeExchange() { return std::exchange(exchange_, std::nullopt); }
  /// Publication time of the newest command; 0 if unknown or by another machine's clock.
  std::int64_t sent_us() const { return sent_us_; }
  /// Fills sequence and origin of each instrument.
  void Describe(torquer_lcm::wire_state_t& out) const;

  /// Health state: "running", or the instruments whose commands are missing.
  std::string State() const;
  /// Health text: changes and refusals since the last call, in a sentence; "" if there are none.
  /// Each instrument and kind of refusal is reported once a minute; the counters have all.
  std::string TakeNews();
  /// Numbers of commands taken and refused.
  bus::HealthCounters Counters() const;

 private:
  enum Refusal { kValue, kSender, kOrder, kRefusals };
  struct Source {
    std::optional<bus::Sender> owner;  // empty before the first command
    std::int64_t heard_us = 0;         // time of the last usable command of the owner
    std::int64_t sequence = -1;
    std::int64_t origin_us = 0;
    bool in_doubt = false;
    bool refused = false;
    bool silent = false;
    std::int64_t named_us[kRefusals] = {};  // time of the last report; 0: never
  };

  bool Owns(const Source& source, std::int64_t now_us) const;
  bool Accepts(Source& source, const std::string& what, std::int64_t sequence,
               const bus::Sender& sender, std::int64_t now_us);
  template <class Value>
  void Set(Source& source, const bus::Sender& sender, std::int64_t now_us, const Value& wanted,
           Value& current);
  void Refuse(Source& source, Refusal kind, std::int64_t now_us, const std::string& what);
  void StopInjector(std::int64_t now_us);
  void SayUnknown(const std::string& instrument, const bus::Sender& sender, std::int64_t now_us);
  void Say(const std::string& what);
  void Combine();

  int FindInstrument(const std::string& name, const bus::Sender& sender, std::int64_t now_us);

  const scene::Scene& scene_;
  const InstrumentPoses start_;
  const std::int64_t clock_id_;
  Command command_;
  std::vector<Source> sources_;
  Source imaging_;
  Source wedges_;
  Source table_;
  Source injector_;
  Source exchanges_;
  std::optional<ExchangeOrder> exchange_;
  std::int64_t exchange_number_ = -1;  // of the newest order
  std::int64_t taken_ = 0;
  std::int64_t unknown_ = 0;
  std::set<std::string> unknown_named_;  // instruments reported in this minute
  std::int64_t unknown_named_us_ = 0;
  std::int64_t refusals_[kRefusals] = {};
  std::int64_t sent_us_ = 0;
  bool fresh_ = false;
  std::string news_;
};

}  // namespace torquer::simulator
