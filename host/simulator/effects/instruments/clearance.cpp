#include "host/simulator/effects/instruments/clearance.h"

#include <algorithm>
#include <limits>
#include <optional>

namespace torquer::effects {

void ClearanceObserver::Restart() { pressed_N_ = end_pressed_N_ = offset_mm_ = 0; }

void ClearanceObserver::CopyFrom(const Effect& twin) {
  const auto& from = dynamic_cast<const ClearanceObserver&>(twin);
  pressed_N_ = from.pressed_N_;
  end_pressed_N_ = from.end_pressed_N_;
  offset_mm_ = from.offset_mm_;
}

void ClearanceObserver::Observe(const TickView& tick) {
  pressed_N_ = end_pressed_N_ = tick.KnowsForces() ? 0 : std::numeric_limits<double>::quiet_NaN();
  offset_mm_ = 0;
  for (const BetweenCurves& between : tick.quadratic.between) {
    if (between.beside) continue;
    pressed_N_ += between.pressed_N;
    end_pressed_N_ += between.end_pressed_N;
    offset_mm_ = std::max(offset_mm_, between.largest_offset_mm);
  }
}

std::vector<Reading> ClearanceObserver::Readings() const {
  return {{"lumen_force_sum_mN", 1e3 * pressed_N_},
          {"lumen_force_end_mN", 1e3 * end_pressed_N_},
          {"lumen_offset_mm", offset_mm_}};
}

namespace {

struct ClearanceSpec : TableSpec {
  std::vector<std::string> around;
  std::optional<double> stiffness_N_mm2;
};

const Keys<ClearanceSpec>& ClearanceKeys() {
  static const Keys<ClearanceSpec> keys =
      Keys<ClearanceSpec>()
          .Otherwise("the instrument around the innermost")
          .Texts(
              "around", &ClearanceSpec::around,
              "instrument, or list of instruments, in whose lumen the inner instruments can move")
          .Otherwise("stiffness of the vessel's wall")
          .Number("stiffness_N_mm2", &ClearanceSpec::stiffness_N_mm2, 1e-3, 1e3, "N/mm^2",
                  "stiffness of the lumen's wall per length of wire; a wall much stiffer than the "
                  "instruments takes several times as long to compute")
          .Example("around = \"catheter\"\n");
  return keys;
}

std::unique_ptr<Effect> MakeClearance(const ClearanceSpec& /*spec*/,
                                      const EffectContext& /*context*/) {
  return std::make_unique<ClearanceObserver>();
}

void GiveRoom(const ClearanceSpec& spec, const std::vector<Instrument>& instruments,
              const WallModel& wall, Clearance& clearance) {
  if (instruments.size() < 2) {
    spec.origin.Refuse("around",
                       "this scene has one instrument, and clearance needs two; add a second "
                       "[[instrument]], or remove [effects.clearance]");
  }
  clearance.stiffness_N_mm2 = spec.stiffness_N_mm2.value_or(wall.stiffness_N_mm2);
  if (spec.around.empty()) clearance.has_room[1] = true;
  for (const std::string& name : spec.around) {
    const int outer = FindInstrument(instruments, name, spec, "around");
    if (outer == 0) {
      spec.origin.Refuse(
          "around",
          "the innermost instrument has no other instrument in its lumen; name one around it");
    }
    clearance.has_room[static_cast<std::size_t>(outer)] = true;
  }
  for (std::size_t k = 0; k < instruments.size(); ++k) {
    clearance.lumen_radius_mm[k] = instruments[k].inner_radius_mm;
  }
}

}  // namespace

EffectKind ClearanceKind() {
  return {.name = "clearance",
          .summary = "radial clearance of instruments in lumens: curves in contact",
          .roles = "setup, observer",
          .keys = Any(ClearanceKeys()),
          .make = MakeWith(MakeClearance),
          .room = [](const std::any& spec, const std::vector<Instrument>& instruments,
                     const WallModel& wall, Clearance& clearance) {
            GiveRoom(std::any_cast<const ClearanceSpec&>(spec), instruments, wall, clearance);
          }};
}

}  // namespace torquer::effects
