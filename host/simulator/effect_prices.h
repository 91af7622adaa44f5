// What each effect takes of the ticks, by the clock.
#pragma once

#include <cstdint>
#include <memory>
#include <string>
#include <utility>
#include <vector>

#include "host/simulator/core/energy_term.h"

namespace torquer::simulator {

/// Measures one tick in kEvery: the roles that an effect takes in a tick, one by one. What it costs
/// in look-ups of the vessel (heartbeat, breathing, compliance) and what it does to the number of
/// iterations is part of the solver's time. Changes nothing that is simulated.
class EffectPrices {
 public:
  static constexpr int kEvery = 16;
  using ClockNs = std::int64_t (*)();

  /// Names of the effects, by their number.
  EffectPrices(std::vector<std::string> effects, ClockNs now_ns);
  ~EffectPrices();
  EffectPrices(const EffectPrices&) = delete;
  EffectPrices& operator=(const EffectPrices&) = delete;

  /// Stands in for `term` of an effect; this and the term must outlive its use.
  EnergyTerm* Watch(std::size_t effect, EnergyTerm* term);

  /// A tick begins.
  void BeginTick();
  /// Whether it is measured.
  bool measures() const { return measures_; }
  /// Calls `act`, and counts its time as that of the effect, not as the solver's.
  template <class Act>
  decltype(auto) Measure(std::size_t effect, Act&& act) {
    const Stopwatch stopwatch(*this, spent_ns_[effect]);
    return act();
  }
  /// Calls `act`, the relaxation of the tick.
  template <class Act>
  decltype(auto) MeasureSolver(Act&& act) {
    const Stopwatch stopwatch(*this, solver_ns_);
    return act();
  }

  /// A price by its name.
  using Price = std::pair<std::string, double>;
  /// Of the ticks since this was called last, us a tick: each effect that took a part in them, and
  /// "solver", the relaxation without the effects' energies. None where no tick was measured.
  std::vector<Price> Take();

 private:
  class WatchedTerm;

  class Stopwatch {
   public:
    Stopwatch(EffectPrices& prices, std::int64_t& to_ns)
        : prices_(prices), to_ns_(to_ns), began_ns_(prices.now_ns_()) {}
    ~Stopwatch() { to_ns_ += prices_.now_ns_() - began_ns_; }
    Stopwatch(const Stopwatch&) = delete;
    Stopwatch& operator=(const Stopwatch&) = delete;

   private:
    EffectPrices& prices_;
    std::int64_t& to_ns_;
    const std::int64_t began_ns_;
  };

  const std::vector<std::string> names_;
  const ClockNs now_ns_;
  std::vector<std::unique_ptr<WatchedTerm>> terms_;
  std::vector<std::int64_t> spent_ns_;   // of effects, beside the relaxation
  std::vector<std::int64_t> within_ns_;  // of their energies, within it
  std::vector<bool> takes_part_;         // has a role that is measured
  std::int64_t solver_ns_ = 0;           // all of the relaxation
  int measured_ = 0;
  int ticks_ = 0;
  bool measures_ = false;
};

}  // namespace torquer::simulator
