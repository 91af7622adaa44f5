#include "host/simulator/effects/instruments/self_contact.h"

#include <limits>

namespace torquer::effects {

void SelfContactObserver::CopyFrom(const Effect& twin) {
  pressed_N_ = dynamic_cast<const SelfContactObserver&>(twin).pressed_N_;
}

void SelfContactObserver::Observe(const TickView& tick) {
  pressed_N_ = tick.KnowsForces() ? 0 : std::numeric_limits<double>::quiet_NaN();
  for (const BetweenCurves& between : tick.quadratic.between) {
    if (between.inner == between.outer || between.turned_back) pressed_N_ += between.pressed_N;
  }
}

std::vector<Reading> SelfContactObserver::Readings() const {
  return {{"self_contact_force_sum_mN", 1e3 * pressed_N_}};
}

namespace {

struct SelfContactSpec : TableSpec {};

const Keys<SelfContactSpec>& SelfContactKeys() {
  static const Keys<SelfContactSpec> keys = Keys<SelfContactSpec>().Example("");
  return keys;
}

std::unique_ptr<Effect> MakeSelfContact(const SelfContactSpec& /*spec*/,
                                        const EffectContext& /*context*/) {
  return std::make_unique<SelfContactObserver>();
}

}  // namespace

EffectKind SelfContactKind() {
  return {.name = "self_contact",
          .summary =
              "contact of each instrument with itself, and with the outside of a catheter that it "
              "has left: loops and coils hold their turns apart",
          .roles = "setup, observer",
          .keys = Any(SelfContactKeys()),
          .make = MakeWith(MakeSelfContact),
          .room = [](const std::any& /*spec*/, const std::vector<Instrument>& /*instruments*/,
                     const WallModel& wall, Clearance& clearance) {
            clearance.touches_itself = true;
            if (clearance.stiffness_N_mm2 == 0) clearance.stiffness_N_mm2 = wall.stiffness_N_mm2;
          }};
}

}  // namespace torquer::effects
