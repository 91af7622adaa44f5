#include "host/simulator/effects/blood/power_injector.h"

#include <algorithm>
#include <limits>

namespace torquer::effects {

namespace {

// Volume that is delivered until a time after the order: the integral of the rate.
double DeliveredML(const InjectorSetUp& set_up, double since_order_s) {
  const double t = std::max(0.0, since_order_s - set_up.delay_s);
  const double effective_s =
      t < set_up.rise_s ? t * t / (2 * set_up.rise_s) : t - set_up.rise_s / 2;
  return std::min(set_up.volume_mL, set_up.rate_mL_s * effective_s);
}

InjectorSetUp Merged(const Injector& ordered, const InjectorSetUp& scene) {
  const auto value = [](double chosen, double of_scene) {
    return chosen == Injector::kAsScene ? of_scene : chosen;
  };
  return {.volume_mL = value(ordered.volume_mL, scene.volume_mL),
          .rate_mL_s = value(ordered.rate_mL_s, scene.rate_mL_s),
          .delay_s = value(ordered.delay_s, scene.delay_s),
          .rise_s = value(ordered.rise_s, scene.rise_s)};
}

}  // namespace

void PowerInjector::Take(const Injector& ordered, double time_s) {
  using Order = Injector::Order;
  const InjectorSetUp set_up = Merged(ordered, scene_);
  const bool is_new = ordered.order != last_;
  last_ = ordered.order;
  if (phase_ == Phase::kInjecting) {
    // The set-up of an injection cannot change.
    if (ordered.order == Order::kInject) return;
    phase_ = Phase::kAborted;
    newest_.aborted = true;
    return;
  }
  if (phase_ == Phase::kArmed && (ordered.order == Order::kOff || set_up != set_up_)) {
    phase_ = Phase::kOff;
  } else if (phase_ == Phase::kArmed && ordered.order == Order::kInject) {
    phase_ = Phase::kInjecting;
    newest_ = {.start_s = time_s, .set_up = set_up_};
    since_order_s_ = 0;
    ++injections_;
  } else if (is_new && ordered.order == Order::kArm) {
    phase_ = Phase::kArmed;
  }
  set_up_ = set_up;
}

double PowerInjector::Deliver(double step_s) {
  if (!injecting()) return 0;
  since_order_s_ += step_s;
  const double until_mL = DeliveredML(newest_.set_up, since_order_s_);
  const double in_step_mL = until_mL - newest_.delivered_mL;
  newest_.delivered_mL = until_mL;
  if (until_mL >= newest_.set_up.volume_mL) phase_ = Phase::kComplete;
  return in_step_mL;
}

double PowerInjector::left_mL() const {
  switch (phase_) {
    case Phase::kArmed:
      return set_up_.volume_mL;
    case Phase::kInjecting:
    case Phase::kAborted:
      return newest_.set_up.volume_mL - newest_.delivered_mL;
    default:
      return 0;
  }
}

std::vector<Reading> PowerInjector::Readings() const {
  const auto of_newest = [this](double value) {
    return injections_ > 0 ? value : std::numeric_limits<double>::quiet_NaN();
  };
  return {{"injector_phase", static_cast<double>(phase_)},
          {"injector_volume_mL", set_up_.volume_mL},
          {"injector_rate_mL_s", set_up_.rate_mL_s},
          {"injector_delay_s", set_up_.delay_s},
          {"injector_rise_s", set_up_.rise_s},
          {"injector_left_mL", left_mL()},
          {"injections", static_cast<double>(injections_)},
          {"injection_start_s", of_newest(newest_.start_s)},
          {"injection_mL", of_newest(newest_.delivered_mL)},
          {"injection_set_mL", of_newest(newest_.set_up.volume_mL)},
          {"injection_rate_mL_s", of_newest(newest_.set_up.rate_mL_s)},
          {"injection_aborted", of_newest(newest_.aborted ? 1 : 0)}};
}

}  // namespace torquer::effects
