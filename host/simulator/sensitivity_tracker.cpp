#include "host/simulator/sensitivity_tracker.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>

#include "host/simulator/scene/value_of_key.h"
#include "host/support/error.h"
#include "host/support/printable_text.h"

namespace torquer::simulator {

namespace {

// Step of a value, in parts of it. With smaller ones rounding counts more, with larger ones the
// curvature of friction's law.
constexpr double kStep = 1e-5;
constexpr double kUnknown = std::numeric_limits<double>::quiet_NaN();

[[noreturn]] void Refuse(const std::string& path, const std::string& problem) {
  throw UserError(fmt::format("{}: derivatives cannot be tracked: {}", path, problem));
}

void CheckScene(const scene::Scene& scene) {
  if (scene.method() == scene::Method::kPaper) {
    Refuse(scene.path(), "the paper's method has none; choose relaxation.method = \"newton\"");
  }
  const InstrumentStack& stack = scene.stack();
  if (stack.curves() > 1 || stack.clearance().touches_itself) {
    Refuse(scene.path(),
           "instruments have room, lie beside each other or touch themselves; remove "
           "[effects.clearance], [effects.self_contact] and [instrument.entry]");
  }
  for (const std::unique_ptr<effects::Effect>& effect : scene.effects()) {
    EnergyTerm* const term = effect->energy_term();
    if (term == nullptr || term->between_term() == nullptr) continue;
    Refuse(scene.path(),
           "friction between instruments has none; remove [effects.friction_between]");
  }
}

// Only such keys leave the way of the hands, the vessel and the segments as they are.
void CheckKey(const scene::Scene& scene, const std::string& key) {
  for (const char* const table : {"instrument.", "effects.", "vessel.wall_stiffness_N_mm2"}) {
    if (key.rfind(table, 0) == 0) return;
  }
  Refuse(scene.path(), fmt::format("\"{}\" is no key of an instrument or of an effect, nor "
                                   "vessel.wall_stiffness_N_mm2; name such a key",
                                   Printable(key)));
}

// True if a wire of both scenes can have the same segments at the same hands.
bool HasSameSegments(const scene::Scene& one, const scene::Scene& other) {
  if (one.start() != other.start() || one.stack().size() != other.stack().size()) return false;
  for (int k = 0; k < one.stack().size(); ++k) {
    const WireModel& a = one.stack().instrument(k);
    const WireModel& b = other.stack().instrument(k);
    if (a.max_length_mm() != b.max_length_mm() || a.spins() != b.spins() ||
        a.most_curved_joints() != b.most_curved_joints() ||
        a.sheath().point_mm != b.sheath().point_mm ||
        a.sheath().direction != b.sheath().direction) {
      return false;
    }
  }
  return true;
}

}  // namespace

SensitivityTracker::SensitivityTracker(const scene::Scene& scene, const WireModel& rod,
                                       const std::vector<std::string>& keys)
    : sensitivities_(rod) {
  CheckScene(scene);
  for (const std::string& key : keys) Add(scene, key);
}

SensitivityTracker::Variant SensitivityTracker::MakeVariant(
    const scene::Scene& base, const std::string& key, const std::vector<double>& numbers) const {
  const TomlValue value = numbers.size() == 1 ? TomlValue(numbers.front()) : TomlValue(numbers);
  Variant variant;
  try {
    variant.scene = std::make_unique<scene::Scene>(scene::With(base.spec(), {{key, value}}), base);
  } catch (const UserError& error) {
    Refuse(base.path(),
           fmt::format("\"{}\" cannot be a little more and a little less: {}", key, error.what()));
  }
  if (!HasSameSegments(base, *variant.scene)) {
    Refuse(base.path(), fmt::format("\"{}\" changes the length or the start of an instrument, or "
                                    "begins to bend it; name another key, or give it a value "
                                    "other than 0",
                                    key));
  }
  variant.wire = variant.scene->MakeShadow();
  return variant;
}

void SensitivityTracker::Add(const scene::Scene& base, const std::string& key) {
  CheckKey(base, key);
  if (std::find(keys_.begin(), keys_.end(), key) != keys_.end()) {
    Refuse(base.path(), fmt::format("\"{}\" is given twice; name it once", key));
  }
  const std::vector<double> numbers = scene::NumbersOf(base.spec(), key);
  const bool is_list = numbers.size() > 1;
  const double value = is_list ? 1 : numbers.front();
  const double step = kStep * (value == 0 ? 1 : std::abs(value));
  for (const double sign : {1.0, -1.0}) {
    std::vector<double> changed = numbers;
    for (double& number : changed)
      number = is_list ? number * (1 + sign * step) : value + sign * step;
    variants_.push_back(MakeVariant(base, key, changed));
  }
  sensitivities_.Add(*variants_[variants_.size() - 2].wire, *variants_.back().wire, step);
  keys_.push_back(key);
  losses_.emplace_back();
  values_.push_back(value);
}

void SensitivityTracker::Restart() {
  time_s_ = 0;
  tick_unknown_.clear();
  losses_.assign(keys_.size(), {});
  readings_lost_ = false;
  for (const Variant& variant : variants_) {
    for (const std::unique_ptr<effects::Effect>& effect : variant.scene->effects()) {
      effect->Restart();
    }
    if (vessel::MovingField* moving = variant.scene->moving_field()) moving->SetTime(0);
  }
}

void SensitivityTracker::AdvanceTime(double time_s, double step_s) {
  time_s_ = time_s;
  for (const Variant& variant : variants_) {
    if (vessel::MovingField* moving = variant.scene->moving_field()) moving->SetTime(time_s);
    for (const std::unique_ptr<effects::Effect>& effect : variant.scene->effects()) {
      if (effects::Timed* timed = effect->timed()) timed->AdvanceTime(step_s);
    }
  }
}

void SensitivityTracker::Look(const TickReport& report, bool outside_lumen) {
  tick_unknown_.clear();
  if (report.snapped) {
    tick_unknown_ = "the wire snapped in the last tick";
    sensitivities_.Lose();
  } else if (outside_lumen) {
    tick_unknown_ = "the wire is outside the lumen";
  } else if (!report.converged) {
    tick_unknown_ = report.stalled ? "the wire is out of balance and no step came nearer to it"
                                   : "the last tick did not converge";
  }
  for (std::size_t k = 0; k < keys_.size(); ++k) {
    std::string unknown = Unknown(k);
    if (unknown.empty()) {
      losses_[k] = {};
    } else if (losses_[k].reason.empty()) {
      losses_[k] = {time_s_, std::move(unknown)};
    }
  }
}

void SensitivityTracker::CopyFrom(const SensitivityTracker& twin) {
  for (std::size_t k = 0; k < variants_.size(); ++k) {
    const auto& from = twin.variants_[k];
    const auto& effects = variants_[k].scene->effects();
    for (std::size_t e = 0; e < effects.size(); ++e) {
      effects[e]->CopyFrom(*from.scene->effects()[e]);
    }
    variants_[k].wire->CopyFrom(*from.wire);
  }
  sensitivities_.CopyFrom(twin.sensitivities_);
  time_s_ = twin.time_s_;
  losses_ = twin.losses_;
  tick_unknown_ = twin.tick_unknown_;
  readings_lost_ = twin.readings_lost_;
}

namespace {

// Observer of an effect that does not evolve; null if there is none.
effects::Observer* ObserverOf(effects::Effect& effect) {
  return effect.evolution() == nullptr ? effect.observer() : nullptr;
}

}  // namespace

void SensitivityTracker::Observe(const effects::TickView& tick) {
  for (std::size_t k = 0; k < keys_.size(); ++k) {
    if (tick.report.converged && !Unknown(k).empty()) readings_lost_ = true;
  }
  for (const Variant& variant : variants_) {
    TickReport report = tick.report;
    report.residual = variant.wire->model().residual;
    report.max_penetration_mm = variant.wire->model().max_penetration_mm;
    const effects::TickView view{.time_s = tick.time_s,
                                 .step_s = tick.step_s,
                                 .controls = tick.controls,
                                 .target = tick.target,
                                 .state = variant.wire->state(),
                                 .quadratic = variant.wire->model(),
                                 .report = report,
                                 .rods = &variant.wire->rods(),
                                 .relaxed_at_start = tick.relaxed_at_start};
    for (const std::unique_ptr<effects::Effect>& effect : variant.scene->effects()) {
      if (effects::Observer* observer = ObserverOf(*effect)) observer->Observe(view);
    }
  }
}

std::vector<effects::Reading> SensitivityTracker::Readings(std::size_t key) const {
  const auto& more = variants_[2 * key].scene->effects();
  const auto& less = variants_[2 * key + 1].scene->effects();
  std::vector<effects::Reading> all;
  for (std::size_t e = 0; e < more.size(); ++e) {
    effects::Observer* const observer = ObserverOf(*more[e]);
    if (observer == nullptr) continue;
    const std::vector<effects::Reading> upper = observer->Readings();
    const std::vector<effects::Reading> lower = less[e]->observer()->Readings();
    for (std::size_t k = 0; k < upper.size(); ++k) {
      const double change = upper[k].value - lower[k].value;
      all.push_back(
          {upper[k].name, readings_lost_ ? kUnknown : change / sensitivities_.spread(key)});
    }
  }
  return all;
}

std::string SensitivityTracker::Unknown(std::size_t key) const {
  using Reason = Sensitivities::Unknown;
  if (!tick_unknown_.empty()) return tick_unknown_;
  switch (sensitivities_.unknown(key)) {
    case Reason::kNone:
      return "";
    case Reason::kNotAtRest:
      return "the last part of the motion did not come to rest";
    case Reason::kUnstable:
      return "the wire is near no stable equilibrium";
    case Reason::kNotSmooth:
      return "the balance has no derivative here: a contact is about to change";
    case Reason::kHistoryLost:
      return "friction or inertia remember a way on which the derivative was not known; restart";
  }
  return "";
}

}  // namespace torquer::simulator
