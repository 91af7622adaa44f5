// A scene, tick by tick: no clock, no bus.
#pragma once

#include <array>
#include <cstdint>
#include <deque>
#include <memory>
#include <optional>
#include <torquer_lcm/wire_state_t.hpp>
#include <vector>

#include "host/simulator/core/relaxation.h"
#include "host/simulator/effect_prices.h"
#include "host/simulator/scene/scene.h"

namespace torquer::simulator {

/// What the hands want.
struct Command {
  /// Of each instrument, past the entry point: the hand's motion and what lay in at the start.
  InstrumentPlaces target;
  bool in_doubt = false;  ///< lift, sensor fault, no device, or no commands any more
  bool refused = false;   ///< what was wanted was not usable, and this is what was before
  /// Simulated, since the start, ascending; negative: a millisecond after the tick before.
  double time_s = -1;
  effects::Controls controls;
};

/// The farthest that an instrument can be wanted, mm or rad, either way.
inline constexpr double kFarthestPlace = 1e5;
/// Whether it can be wanted there: finite, and within kFarthestPlace.
bool Usable(const InstrumentPlace& place);
/// Whether an X-ray system can be set so: all within their ranges.
bool Usable(const effects::Imaging& imaging);
/// Whether the C-arm can be turned so: finite, and within half a turn. Not of `imaging`.
bool Usable(const effects::Controls& controls);

/// Runs a scene. The same commands and budgets give the same states, bit for bit.
class Simulation {
 public:
  /// `scene` must outlive the simulation.
  explicit Simulation(scene::Scene& scene) : Simulation(scene, nullptr) {}
  /// With the price of each effect of the scene, which must outlive the simulation; null: none.
  Simulation(scene::Scene& scene, EffectPrices* prices);
  /// Where `twin` stands, which runs another scene of the same spec; see CopyFrom.
  Simulation(scene::Scene& scene, const Simulation& twin);

  /// One tick towards `command`. Places or angles that are not Usable are refused: the last good
  /// ones stand, and the state says so.
  const TickReport& Tick(const Command& command, WorkBudget& budget);
  /// Appends a record of every attempt of the method from now on; null: none.
  void RecordAttempts(std::vector<AttemptRecord>* records) { relaxation_->Record(records); }
  /// Back to the start of the scene.
  void Restart();
  /// Goes on from where `twin` stands, which runs a scene of the same spec: the same commands then
  /// give the same states, bit for bit. Neither is in a tick.
  void CopyFrom(const Simulation& twin);

  const scene::Scene& scene() const { return scene_; }
  const WireState& state() const { return state_; }
  const Relaxation& relaxation() const { return *relaxation_; }
  /// Of the present state; see Relaxation::SolverErrorMm.
  double SolverErrorMm() { return relaxation_->SolverErrorMm(state_); }
  /// The same; see Relaxation::DiscretizationErrorMm.
  double DiscretizationErrorMm() { return relaxation_->DiscretizationErrorMm(state_); }
  const TickReport& report() const { return report_; }
  /// Of all that decides the motion from here on: the wire, and what the method and the energy
  /// terms remember.
  std::uint64_t state_hash() const { return hash_; }
  std::int64_t tick() const { return tick_; }
  int status() const { return status_; }     ///< protocol::WireStatus bits
  double time_s() const { return time_s_; }  ///< simulated, since the start
  /// Whether the scene goes on by itself, so that ticks count even where the hands rest.
  bool lives() const { return lives_; }
  /// The longest tick, s, with which what depends on time is true: 1 ms, as live, where the wire
  /// has inertia; 5 ms where the vessel moves or an effect evolves (within 2 um of 0.5 ms);
  /// infinite where a long tick is the same as two short ones.
  double longest_tick_s() const;
  /// Whether the wire is at rest where the hands want it.
  bool at_rest() const { return report_.converged && report_.arrived(); }
  /// Where the wire touches the wall: one a segment at most, with the deepest of its points.
  struct Contact {
    int node = 0;  ///< the distal one of the segment
    double penetration_mm = 0;
  };
  std::vector<Contact> Contacts() const;
  /// What the observers of the scene have found.
  std::vector<effects::Reading> Readings() const;
  /// Along the wire, of the present state; null where no effect looks for it.
  const InternalForces* forces() const {
    return along_wire_ == nullptr ? nullptr : along_wire_->AlongWire();
  }
  /// At the hand of each instrument; null where forces() is.
  const std::array<HandForce, kMostInstruments>* hands() const {
    return along_wire_ == nullptr ? nullptr : along_wire_->AtHands();
  }
  /// How many planes make pictures of the scene, the C-arm's being the first.
  std::size_t image_count() const { return images_.size(); }
  /// One of them; null where there is none.
  effects::ImageSource* image(std::size_t plane = 0) const {
    return plane < images_.size() ? images_[plane].role : nullptr;
  }
  /// Whether the last tick took something for a picture of it.
  bool picture_due(std::size_t plane = 0) const {
    return plane < images_.size() && pictures_due_[plane];
  }
  /// Null where none are looked for.
  EffectPrices* prices() const { return prices_; }
  /// Absolute: past the entry point.
  const InstrumentPlaces& target() const { return target_; }

  /// Fills all that the simulation knows of a message; times, and what concerns commands, stay as
  /// they are.
  void Describe(torquer_lcm::wire_state_t& out) const;

 private:
  // What a tick was given, and did.
  struct Done {
    InstrumentPlaces target;
    double time_s = 0;
    int work = 0;
  };

  // A role, and the number of the effect that takes it.
  template <class T>
  struct Part {
    T* role;
    std::size_t effect;
  };

  void FindRoles();
  template <class Act>
  void Priced(std::size_t effect, Act&& act);
  void DescribeInstruments(torquer_lcm::wire_state_t& out) const;
  void DescribeShape(torquer_lcm::wire_state_t& out) const;
  void DescribeContacts(torquer_lcm::wire_state_t& out) const;
  void DescribePast(torquer_lcm::wire_state_t& out) const;
  void Observe();
  void Relax(WorkBudget& budget);
  void RunEffects(double step_s, const effects::Controls& controls);

  scene::Scene& scene_;
  std::unique_ptr<Relaxation> relaxation_;
  EffectPrices* const prices_ = nullptr;
  std::vector<effects::Timed*> timed_;
  std::vector<Part<effects::Evolution>> evolutions_;
  std::vector<Part<effects::Observer>> observers_;
  const effects::Observer* along_wire_ = nullptr;
  std::vector<Part<effects::ImageSource>> images_;
  std::vector<bool> pictures_due_;
  bool lives_ = false;
  WireState state_;
  TickReport report_;
  double time_s_ = 0;
  InstrumentPlaces target_;
  effects::Controls controls_;
  std::deque<Done> done_;  // the newest first
  std::int64_t tick_ = 0;
  std::int64_t updates_ = 0;
  std::uint64_t hash_ = 0;
  int status_ = 0;
};

/// Most nodes of one message; longer wires are sent with a stride.
inline constexpr int kMostNodesInMessage = 2000;
/// Most earlier ticks of one message, so that a replay can make up for states that were lost.
inline constexpr int kMostPastInMessage = 32;

}  // namespace torquer::simulator
