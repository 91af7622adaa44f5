// Power injector: injects a volume of contrast agent by itself, after a delay, with a rate that
// rises linearly.
//
//   rate ^      ____________
//        |     /            |      volume = rate * (time of injection - rise / 2)
//        |____/_____________|__> time since the order
//        delay rise
#pragma once

#include <optional>
#include <vector>

#include "host/simulator/effects/effect.h"

namespace torquer::effects {

struct InjectorSetUp {
  double volume_mL = 0;
  double rate_mL_s = 0;
  double delay_s = 0;
  double rise_s = 0;
  bool operator==(const InjectorSetUp&) const = default;
};

/// Armed for one injection at a time, with the set-up of that moment. Another set-up disarms it.
class PowerInjector {
 public:
  enum class Phase { kOff, kArmed, kInjecting, kComplete, kAborted };

  /// `scene`: set-up for values that the operator leaves to the scene.
  explicit PowerInjector(const InjectorSetUp& scene) : scene_(scene), set_up_(scene) {}

  void Restart() { *this = PowerInjector(scene_); }
  /// Takes the operator's order at a time.
  void Take(const Injector& ordered, double time_s);
  /// Goes on by a step. Returns the volume delivered in it, mL.
  double Deliver(double step_s);

  Phase phase() const { return phase_; }
  bool injecting() const { return phase_ == Phase::kInjecting; }
  std::vector<Reading> Readings() const;

 private:
  struct Injection {
    double start_s = 0;  // of the order
    InjectorSetUp set_up;
    double delivered_mL = 0;
    bool aborted = false;
  };

  double left_mL() const;

  InjectorSetUp scene_;
  InjectorSetUp set_up_;  // in effect now
  Phase phase_ = Phase::kOff;
  Injector::Order last_ = Injector::Order::kOff;
  int injections_ = 0;
  Injection newest_;
  double since_order_s_ = 0;  // of the injection in progress
};

}  // namespace torquer::effects
