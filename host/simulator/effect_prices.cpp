#include "host/simulator/effect_prices.h"

#include <algorithm>

namespace torquer::simulator {

// Wrapper of an energy term that measures its time.
class EffectPrices::WatchedTerm final : public EnergyTerm, public ContactTerm, public TimedTerm {
 public:
  WatchedTerm(EffectPrices& prices, std::size_t effect, EnergyTerm* term)
      : prices_(prices), effect_(effect), term_(*term) {}

  void Begin(const PointSet& points) override {
    Timed([&] { term_.Begin(points); });
  }
  bool Dissipates() const override { return term_.Dissipates(); }
  double Add(const PointSet& points, PointDerivatives& out) const override {
    return Timed([&] { return term_.Add(points, out); });
  }
  void End(const PointSet& points) override {
    Timed([&] { term_.End(points); });
  }
  void Reset() override { term_.Reset(); }
  std::uint64_t Hash(std::uint64_t seed) const override { return term_.Hash(seed); }

  ContactTerm* contact_term() override { return term_.contact_term() == nullptr ? nullptr : this; }
  void MoveSurfaces(const PointSet& points,
                    const std::array<SurfaceMove, kMostInstruments>& moves) override {
    Timed([&] { term_.contact_term()->MoveSurfaces(points, moves); });
  }
  bool ActsOnWall() const override { return term_.contact_term()->ActsOnWall(); }

  TimedTerm* timed_term() override { return term_.timed_term() == nullptr ? nullptr : this; }
  void SetMotionFraction(double fraction) override {
    Timed([&] { term_.timed_term()->SetMotionFraction(fraction); });
  }

  BetweenTerm* between_term() override { return term_.between_term(); }

 private:
  template <class Act>
  auto Timed(Act&& act) const -> decltype(act()) {
    if (!prices_.measures_) return act();
    const Stopwatch stopwatch(prices_, prices_.within_ns_[effect_]);
    return act();
  }

  EffectPrices& prices_;
  const std::size_t effect_;
  EnergyTerm& term_;
};

EffectPrices::EffectPrices(std::vector<std::string> effects, ClockNs now_ns)
    : names_(std::move(effects)),
      now_ns_(now_ns),
      spent_ns_(names_.size()),
      within_ns_(names_.size()),
      takes_part_(names_.size()) {}

EffectPrices::~EffectPrices() = default;

EnergyTerm* EffectPrices::Watch(std::size_t effect, EnergyTerm* term) {
  return terms_.emplace_back(std::make_unique<WatchedTerm>(*this, effect, term)).get();
}

void EffectPrices::BeginTick() {
  measures_ = ticks_++ % kEvery == 0;
  measured_ += measures_;
}

std::vector<EffectPrices::Price> EffectPrices::Take() {
  std::vector<Price> prices;
  if (measured_ == 0) return prices;
  const auto us_a_tick = [this](std::int64_t ns) {
    return 1e-3 * static_cast<double>(ns) / measured_;
  };
  std::int64_t within_ns = 0;
  for (std::size_t effect = 0; effect < names_.size(); ++effect) {
    const std::int64_t ns = spent_ns_[effect] + within_ns_[effect];
    within_ns += within_ns_[effect];
    takes_part_[effect] = takes_part_[effect] || ns > 0;
    if (takes_part_[effect]) prices.emplace_back(names_[effect], us_a_tick(ns));
  }
  prices.emplace_back("solver", us_a_tick(solver_ns_ - within_ns));
  std::fill(spent_ns_.begin(), spent_ns_.end(), 0);
  std::fill(within_ns_.begin(), within_ns_.end(), 0);
  solver_ns_ = 0;
  measured_ = 0;
  return prices;
}

}  // namespace torquer::simulator
