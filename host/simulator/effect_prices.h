// Measures the computing time of each effect in a tick.
#pragma once

#include <cstdint>
#include <memory>
#include <string>
#include <utility>
#include <vector>

#include "host/simulator/core/energy_term.h"

namespace torquer::simulator {

/// Measures one tick in kEvery, separately for each role that an effect takes in a tick. The
/// solver's time includes an effect's look-ups of the vessel (heartbeat, breathing, compliance). It
/// also includes the additional iterations that an effect causes. The measurement does not affect
/// the simulation.
class EffectPrices {
 public:
  static constexpr int kEvery = 16;
  using ClockNs = std::int64_t (*)();

  /// `effects`: names of the effects by index. `now_ns`: clock, ns.
  EffectPrices(std::vector<std::string> effects, ClockNs now_ns);
  ~EffectPrices();
  EffectPrices(const EffectPrices&) = delete;
  EffectPrices& operator=(const EffectPrices&) = delete;

  /// Returns a stand-in that measures the time of `term`. This object and `term` must outlive it.
  EnergyTerm* Watch(std::size_t effect, EnergyTerm* term);

  /// Marks the beginning of a tick.
  void BeginTick();
  /// True if the present tick is measured.
  bool measures() const { return measures_; }
  /// Calls `act` and adds its time to the effect, not to the solver.
  template <class Act>
  decltype(auto) Measure(std::size_t effect, Act&& act) {
    const Stopwatch stopwatch(*this, spent_ns_[effect]);
    return act();
  }
  /// Calls `act`, the relaxation of the tick, and adds its time to the solver.
  template <class Act>
  decltype(auto) MeasureSolver(Act&& act) {
    const Stopwatch stopwatch(*this, solver_ns_);
    return act();
  }

  /// Name, and time in us a tick.
  using Price = std::pair<std::string, double>;
  /// Mean times of the measured ticks since the last call, us a tick. Lists each effect that ever
  /// took time, and "solver", the relaxation without the effects' energies. Empty if no tick was
  /// measured.
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
  std::vector<std::int64_t> spent_ns_;   // of each effect, outside the relaxation
  std::vector<std::int64_t> within_ns_;  // of each effect's energy term, within the relaxation
  std::vector<bool> takes_part_;         // the effect ever took time
  std::int64_t solver_ns_ = 0;           // of the whole relaxation
  int measured_ = 0;
  int ticks_ = 0;
  bool measures_ = false;
};

}  // namespace torquer::simulator
