// Runs a scene tick by tick, without a clock and without a bus.
#pragma once

#include <array>
#include <cstdint>
#include <deque>
#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <torquer_lcm/wire_state_t.hpp>
#include <vector>

#include "host/simulator/core/relaxation.h"
#include "host/simulator/effect_prices.h"
#include "host/simulator/effects/observers/vital_signs.h"
#include "host/simulator/scene/scene.h"
#include "host/simulator/sensitivity_tracker.h"

namespace torquer::simulator {

/// Command to a tick.
struct Command {
  /// Target of each instrument, past the entry point: the hand's motion plus the inserted length at
  /// the start.
  InstrumentPoses target;
  bool in_doubt = false;  ///< lift, sensor fault, no device, or commands have stopped
  bool refused = false;   ///< the new command was not usable, and this is the one before
  /// Simulated time since the start, ascending; negative: 1 ms after the tick before.
  double time_s = -1;
  effects::Controls controls;
};

/// An instrument became another device.
struct DeviceExchange {
  std::int64_t tick = 0;  ///< last tick with the device before
  double time_s = 0;      ///< simulated time of that tick
  int instrument = 0;
  std::string device;              ///< name in host/devices
  std::uint64_t content_hash = 0;  ///< of the scene since then

  bool operator==(const DeviceExchange&) const = default;
};

/// Runs a scene. The same commands and budgets give the same states, bit for bit.
class Simulation {
 public:
  /// `scene` must outlive the simulation.
  explicit Simulation(scene::Scene& scene) : Simulation(scene, nullptr) {}
  /// `prices` measures each effect of the scene and must outlive the simulation; null: no
  /// measurement.
  Simulation(scene::Scene& scene, EffectPrices* prices);
  /// Starts in the state of `twin`, which runs another scene of the same spec; see CopyFrom.
  Simulation(scene::Scene& scene, const Simulation& twin);
  /// Continues `before` with another device as `instrument`, which `scene` has by
  /// Scene::WithDevice. Call before.CheckExchange first. Effects are measured as before.
  Simulation(scene::Scene& scene, const Simulation& before, int instrument);

  /// Makes one tick towards `command`. Poses or controls that are not valid are refused: the last
  /// usable ones stay valid, and the status reports it.
  const TickReport& Tick(const Command& command, WorkBudget& budget);
  /// Appends a record of every attempt of the method from now on; null: no records.
  void RecordAttempts(std::vector<AttemptRecord>* records) { relaxation_->Record(records); }
  /// Returns to the start of the scene.
  void Restart();
  /// Tracks the derivatives of the states by values of the scene from now on; none: no tracking, at
  /// no cost. Only at the start of the scene. Throws UserError for a scene or a key without
  /// derivatives.
  void TrackSensitivities(const std::vector<std::string>& keys);
  /// Null if nothing is tracked.
  const SensitivityTracker* sensitivities() const { return tracker_.get(); }
  /// Copies the state of `twin`, which runs a scene of the same spec. The same commands then give
  /// the same states, bit for bit. Neither may be in a tick.
  void CopyFrom(const Simulation& twin);
  /// Throws UserError naming the remedy if another device cannot become this instrument now. It
  /// must be withdrawn, so that no shape, force or memory depends on it.
  void CheckExchange(int instrument) const;
  /// All exchanges since the start of the scene, in their order.
  const std::vector<DeviceExchange>& exchanges() const { return exchanges_; }
  /// Content hash of the scene before any exchange.
  std::uint64_t content_hash_at_start() const { return hash_at_start_; }

  const scene::Scene& scene() const { return scene_; }
  const WireState& state() const { return state_; }
  const Relaxation& relaxation() const { return *relaxation_; }
  /// Error of the present state; see Relaxation::SolverErrorMm.
  double SolverErrorMm() { return relaxation_->SolverErrorMm(state_); }
  /// Error of the present state; see Relaxation::DiscretizationErrorMm.
  double DiscretizationErrorMm() { return relaxation_->DiscretizationErrorMm(state_); }
  const TickReport& report() const { return report_; }
  /// Hash of everything that decides the further motion: the wire, and the memory of the method and
  /// the energy terms.
  std::uint64_t state_hash() const { return hash_; }
  std::int64_t tick() const { return tick_; }
  int status() const { return status_; }     ///< protocol::WireStatus bits
  double time_s() const { return time_s_; }  ///< simulated time since the start
  /// True if the scene evolves by itself, so that ticks go on while the hands rest.
  bool is_time_dependent() const { return is_time_dependent_; }
  /// Longest tick of a script, s. At most 1 ms, as live, if the wire has inertia. The scene's
  /// longest_tick_ms, if the vessel moves or an effect evolves. Its default of 5 ms gives shapes
  /// within 2 um of those with 0.5 ms. Infinite if one long tick equals two short ones.
  double longest_tick_s() const;
  /// True if the wire is at rest at its targets.
  bool at_rest() const { return report_.converged && report_.arrived(); }
  /// Calls `visit` for each segment of a curve that touches the wall, in order towards the tip. It
  /// gets the distal node of the segment and the depth of its deepest point, > 0.
  void VisitContacts(int curve,
                     const std::function<void(int node, double penetration_mm)>& visit) const;
  /// Readings of the observers of the scene.
  std::vector<effects::Reading> Readings() const;
  /// Forces along the wire in the present state; null if no effect computes them.
  const InternalForces* forces() const {
    return along_wire_ == nullptr ? nullptr : along_wire_->AlongWire();
  }
  /// Forces at the hand of each instrument; null if forces() is null.
  const std::array<HandForce, kMostInstruments>* hands() const {
    return along_wire_ == nullptr ? nullptr : along_wire_->AtHands();
  }
  /// Curves of the patient monitor; null if the scene has none.
  const effects::VitalSigns* vitals() const {
    return patient_ == nullptr ? nullptr : patient_->Vitals();
  }
  /// Number of planes with pictures of the scene; the first one is the C-arm's.
  std::size_t image_count() const { return images_.size(); }
  /// Picture source of a plane; null if there is none.
  effects::ImageSource* image(std::size_t plane = 0) const {
    return plane < images_.size() ? images_[plane].role : nullptr;
  }
  /// True if the last tick took a frame in the plane.
  bool picture_due(std::size_t plane = 0) const {
    return plane < images_.size() && pictures_due_[plane];
  }
  /// Null if effects are not measured.
  EffectPrices* prices() const { return prices_; }
  /// Absolute targets, past the entry point.
  const InstrumentPoses& target() const { return target_; }
  /// Places that the instruments go to: the targets within the instruments' lengths. An instrument
  /// that has left the model goes no farther than where it is held.
  InstrumentPoses goal() const;

  /// Fills all fields of a message that the simulation knows. Clock times and fields about commands
  /// stay unchanged.
  void Describe(torquer_lcm::wire_state_t& out) const;

 private:
  // Input and work of a tick.
  struct Done {
    InstrumentPoses target;
    double time_s = 0;
    int work = 0;
  };

  // A role, and the index of the effect that takes it.
  template <class T>
  struct EffectRole {
    T* role;
    std::size_t effect;
  };

  void FindRoles();
  effects::TickView View(double step_s, const effects::Controls& controls,
                         bool relaxed_at_start) const;
  template <class Act>
  void Priced(std::size_t effect, Act&& act);
  void DescribeInstruments(torquer_lcm::wire_state_t& out) const;
  void DescribeOwnNodes(int k, torquer_lcm::instrument_state_t& out) const;
  void DescribeShape(torquer_lcm::wire_state_t& out) const;
  void DescribeContacts(torquer_lcm::wire_state_t& out) const;
  void DescribePast(torquer_lcm::wire_state_t& out) const;
  void Observe();
  void Relax(WorkBudget& budget);
  TickReport RelaxToTarget(WorkBudget& budget);
  void RunEffects(double step_s, const effects::Controls& controls, bool relaxed_at_start = false);
  void CopyTracker(const Simulation& twin);

  scene::Scene& scene_;
  std::unique_ptr<Relaxation> relaxation_;
  std::unique_ptr<SensitivityTracker> tracker_;  // null without tracking
  EffectPrices* const prices_ = nullptr;
  std::vector<effects::Timed*> timed_;
  std::vector<EffectRole<effects::Evolution>> evolutions_;
  std::vector<EffectRole<effects::Observer>> observers_;
  const effects::Observer* along_wire_ = nullptr;
  const effects::Observer* patient_ = nullptr;
  std::vector<EffectRole<effects::ImageSource>> images_;
  std::vector<bool> pictures_due_;
  effects::MotionLimit* limit_ = nullptr;
  EffectRole<effects::Comparison> comparison_{};
  std::unique_ptr<scene::Scene> coarse_scene_;  // null without a comparison
  std::unique_ptr<Simulation> coarse_;          // runs coarse_scene_
  bool is_time_dependent_ = false;
  WireState state_;
  TickReport report_;
  double time_s_ = 0;
  InstrumentPoses target_;
  effects::Controls controls_;
  std::deque<Done> done_;  // the newest first
  std::int64_t tick_ = 0;
  std::int64_t updates_ = 0;
  std::uint64_t hash_ = 0;
  int status_ = 0;
  std::vector<DeviceExchange> exchanges_;
  std::uint64_t hash_at_start_ = 0;
};

/// Maximum number of nodes in one message; longer wires are sent with a stride.
inline constexpr int kMostNodesInMessage = 2000;
/// Maximum number of nodes of an instrument's own curve in one message, except its tip. Smaller, so
/// that a message with three such instruments stays below 65,499 bytes.
inline constexpr int kMostOwnNodesInMessage = 500;
/// Maximum number of earlier ticks in one message, from which a replay restores lost states.
inline constexpr int kMostPastInMessage = 32;

}  // namespace torquer::simulator
