#include "host/simulator/effects/observers/internal_forces.h"

#include <algorithm>
#include <cassert>
#include <limits>

#include "host/simulator/effects/contact/friction_between.h"

namespace torquer::effects {

InternalForceObserver::InternalForceObserver(const EffectContext& context) {
  for (const Instrument& instrument : context.instruments) names_.push_back(instrument.name);
  if (context.earlier == nullptr) return;
  for (const std::unique_ptr<Effect>& effect : *context.earlier) {
    if (EnergyTerm* const term = effect->energy_term()) terms_.push_back(term);
  }
  if (const auto* friction = FindEarlier<FrictionBetween>(context)) sliding_ = &friction->sliding();
}

void InternalForceObserver::CopyFrom(const Effect& twin) {
  const auto& from = dynamic_cast<const InternalForceObserver&>(twin);
  forces_ = from.forces_;
  hands_ = from.hands_;
  at_hands_ = from.at_hands_;
}

void InternalForceObserver::Restart() {
  forces_ = {};
  hands_ = {};
  at_hands_ = {};
}

void InternalForceObserver::Observe(const TickView& tick) {
  assert(tick.rods != nullptr);
  const CombinedRods& rods = *tick.rods;
  FindInternalForces(rods[tick.state.FarthestCurve()], tick.state, tick.quadratic, terms_, forces_);
  hands_.Find(rods, tick.state, tick.quadratic, forces_,
              sliding_ == nullptr ? Sliding() : *sliding_);
  at_hands_ = hands_.hands();
  if (!tick.KnowsForces()) Forget();
}

// The curve keeps its nodes, each with unknown forces.
void InternalForceObserver::Forget() {
  constexpr double kUnknown = std::numeric_limits<double>::quiet_NaN();
  for (Eigen::Vector3d& force_N : forces_.contact_N) force_N.setConstant(kUnknown);
  for (std::vector<double>* values :
       {&forces_.line_load_N_mm, &forces_.tension_N, &forces_.bending_mJ, &forces_.twisting_mJ}) {
    std::fill(values->begin(), values->end(), kUnknown);
  }
  forces_.clamp_force_N.setConstant(kUnknown);
  forces_.clamp_moment_mJ.setConstant(kUnknown);
  at_hands_.fill({.axial_N = kUnknown, .torque_mJ = kUnknown});
}

std::vector<Reading> InternalForceObserver::Readings() const {
  std::vector<Reading> readings;
  for (std::size_t k = 0; k < names_.size(); ++k) {
    readings.push_back({names_[k] + ".hand_force_mN", 1e3 * at_hands_[k].axial_N});
    readings.push_back({names_[k] + ".hand_torque_mN_mm", 1e3 * at_hands_[k].torque_mJ});
  }
  return readings;
}

namespace {

struct InternalForcesSpec : TableSpec {};

const Keys<InternalForcesSpec>& InternalForcesKeys() {
  static const Keys<InternalForcesSpec> keys = Keys<InternalForcesSpec>().Example("");
  return keys;
}

std::unique_ptr<Effect> MakeInternalForces(const InternalForcesSpec& /*spec*/,
                                           const EffectContext& context) {
  return std::make_unique<InternalForceObserver>(context);
}

}  // namespace

EffectKind InternalForcesKind() {
  return {.name = "internal_forces",
          .summary =
              "contact force, line load, tension and moments along the wire; force and torque at "
              "the hand of each instrument",
          .roles = "observer",
          .keys = Any(InternalForcesKeys()),
          .make = MakeWith(MakeInternalForces)};
}

}  // namespace torquer::effects
