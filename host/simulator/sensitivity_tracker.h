// Sensitivity tracker: derivatives of a scene's states by values of its keys.
#pragma once

#include <Eigen/Core>
#include <memory>
#include <string>
#include <vector>

#include "host/simulator/core/newton/sensitivities.h"
#include "host/simulator/core/relaxation.h"
#include "host/simulator/scene/scene.h"

namespace torquer::simulator {

/// Has two variants of the scene for each key, with a slightly larger and a slightly smaller value.
/// They share the vessel. Their wires are shadows of the simulated one (core/README.md, section
/// 20).
class SensitivityTracker {
 public:
  /// `rod`: of the relaxation that it follows. Throws UserError naming the key and the remedy if
  /// the scene or a key cannot be tracked.
  SensitivityTracker(const scene::Scene& scene, const WireModel& rod,
                     const std::vector<std::string>& keys);

  const std::vector<std::string>& keys() const { return keys_; }
  /// Value of a key: the number itself; 1, the common factor, for a list.
  double value(std::size_t key) const { return values_[key]; }
  PartFollower& follower() { return sensitivities_; }

  /// Returns to the start of the scene. The relaxation restarts after it.
  void Restart();
  /// Call it before each tick is relaxed, ..
  void AdvanceTime(double time_s, double step_s);
  /// .. and after it, ..
  void Look(const TickReport& report, bool outside_lumen);
  /// .. and then with the view of the simulation, also at the start.
  void Observe(const effects::TickView& tick);
  /// Takes over the state of `twin`, which tracks the same keys of a scene of the same spec.
  void CopyFrom(const SensitivityTracker& twin);

  /// Reason for which the derivatives by a key are not known in the present state; empty if they
  /// are.
  std::string Unknown(std::size_t key) const;
  /// Tick since which the derivatives by a key have not been known.
  struct Loss {
    double time_s = 0;
    std::string reason;  ///< after that tick; empty: they are known, or not known from the start on
  };
  const Loss& LossOf(std::size_t key) const { return losses_[key]; }
  /// Derivatives of the nodes, mm per unit of the key. Valid if they are known.
  const std::vector<Eigen::Vector3d>& nodes_mm(std::size_t key) const {
    return sensitivities_.nodes_mm(key);
  }
  /// Derivatives of the observers' readings per unit of the key; NaN: not known. Without readings
  /// of effects that evolve, such as the flow.
  std::vector<effects::Reading> Readings(std::size_t key) const;

 private:
  // A scene with another value, and its wire.
  struct Variant {
    std::unique_ptr<scene::Scene> scene;
    std::unique_ptr<ShadowWire> wire;
  };

  Variant MakeVariant(const scene::Scene& base, const std::string& key,
                      const std::vector<double>& numbers) const;
  void Add(const scene::Scene& base, const std::string& key);

  std::vector<std::string> keys_;
  std::vector<double> values_;
  std::vector<Loss> losses_;
  double time_s_ = 0;              // of the last tick
  std::vector<Variant> variants_;  // two for each key: more, less
  Sensitivities sensitivities_;
  std::string tick_unknown_;  // reason of the last tick; empty if there is none
  // A tick was observed without derivatives, and readings may remember it.
  bool readings_lost_ = false;
};

}  // namespace torquer::simulator
