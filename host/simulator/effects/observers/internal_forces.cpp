#include "host/simulator/effects/observers/internal_forces.h"

#include <cmath>

namespace torquer::effects {

InternalForceObserver::InternalForceObserver(double friction_between, const EffectContext& context)
    : stack_(*context.stack) {
  sliding_.coefficient = friction_between;
  for (const Instrument& instrument : context.instruments) names_.push_back(instrument.name);
  if (context.earlier == nullptr) return;
  for (const std::unique_ptr<Effect>& effect : *context.earlier) {
    if (EnergyTerm* const term = effect->energy_term()) terms_.push_back(term);
  }
}

void InternalForceObserver::CopyFrom(const Effect& twin) {
  const auto& from = dynamic_cast<const InternalForceObserver&>(twin);
  sliding_ = from.sliding_;
  insertion_mm_ = from.insertion_mm_;
  forces_ = from.forces_;
  hands_ = from.hands_;
}

void InternalForceObserver::Restart() {
  sliding_.direction = {};
  insertion_mm_.clear();
  forces_ = {};
  hands_ = {};
}

void InternalForceObserver::FollowSliding(const InstrumentPlaces& places) {
  constexpr double kStillMm = 1e-6;
  std::vector<double> here;
  for (const InstrumentPlace& place : places) here.push_back(place.insertion_mm);
  for (std::size_t k = 0; k < insertion_mm_.size(); ++k) {
    for (std::size_t m = k + 1; m < insertion_mm_.size(); ++m) {
      const double slid_mm = (here[k] - insertion_mm_[k]) - (here[m] - insertion_mm_[m]);
      if (std::abs(slid_mm) > kStillMm) sliding_.direction[k][m] = slid_mm > 0 ? 1 : -1;
    }
  }
  insertion_mm_ = std::move(here);
}

void InternalForceObserver::Observe(const TickView& tick) {
  FollowSliding(tick.state.places());
  FindInternalForces(stack_.rod(), tick.state, tick.expansion, terms_, forces_);
  hands_.Find(stack_, tick.state, tick.expansion.points, forces_, sliding_);
}

std::vector<Reading> InternalForceObserver::Readings() const {
  std::vector<Reading> readings;
  for (std::size_t k = 0; k < names_.size(); ++k) {
    readings.push_back({names_[k] + ".hand_force_mN", 1e3 * hands_.hands()[k].axial_N});
    readings.push_back({names_[k] + ".hand_torque_mN_mm", 1e3 * hands_.hands()[k].torque_mJ});
  }
  return readings;
}

namespace {

struct InternalForcesSpec : TableSpec {
  double friction_between = 0;
};

const Keys<InternalForcesSpec>& InternalForcesKeys() {
  static const Keys<InternalForcesSpec> keys =
      Keys<InternalForcesSpec>()
          .Number("friction_between", &InternalForcesSpec::friction_between, 0, 2, "",
                  "coefficient of Coulomb's law between instruments within each other, in what "
                  "their hands feel")
          .Example("friction_between = 0.05\n");
  return keys;
}

std::unique_ptr<Effect> Make(const InternalForcesSpec& spec, const EffectContext& context) {
  return std::make_unique<InternalForceObserver>(spec.friction_between, context);
}

}  // namespace

EffectKind InternalForcesKind() {
  return {.name = "internal_forces",
          .summary =
              "contact force, line load, tension and moments along the wire; force and torque at "
              "the hand of each instrument",
          .roles = "observer",
          .keys = Any(InternalForcesKeys()),
          .make = MakeWith(Make)};
}

}  // namespace torquer::effects
