// One wire in one scene, tick by tick: no clock, no bus.
#pragma once

#include <cstdint>
#include <deque>
#include <memory>
#include <optional>
#include <torquer_lcm/wire_state_t.hpp>

#include "host/simulator/core/relaxation.h"
#include "host/simulator/scene/scene.h"

namespace torquer::simulator {

/// A command, as far as a wire follows it.
struct Command {
  std::int64_t sequence = -1;
  HandTarget target;      ///< past the entry point: the hand's motion and what lay in at the start
  bool in_doubt = false;  ///< lift, sensor fault or no device
  /// Simulated, since the start, ascending; negative: a millisecond after the tick before.
  double time_s = -1;
  effects::Controls controls;
};

/// Runs a scene. The same commands and budgets give the same states, bit for bit.
class Session {
 public:
  /// `scene` must outlive the session.
  explicit Session(scene::Scene& scene);

  /// One tick towards `command`. A target that is not finite, or beyond 1e5 mm or 1e5 rad, is
  /// refused: the last good one stands, and the state says so.
  const TickReport& Tick(const Command& command, WorkBudget& budget);
  /// Back to the start of the scene.
  void Restart();

  const scene::Scene& scene() const { return scene_; }
  const WireState& state() const { return state_; }
  const Relaxation& relaxation() const { return *relaxation_; }
  const TickReport& report() const { return report_; }
  std::uint64_t state_hash() const { return hash_; }
  std::int64_t tick() const { return tick_; }
  int status() const { return status_; }     ///< protocol::WireStatus bits
  double time_s() const { return time_s_; }  ///< simulated, since the start
  /// Whether the scene goes on by itself, so that ticks count even where the hand rests.
  bool lives() const { return lives_; }
  /// What the observers of the scene have found.
  std::vector<effects::Reading> Readings() const;
  /// Makes pictures of the scene; null where no effect does.
  effects::ImageSource* image() const { return image_; }
  /// Whether the last tick took something for a picture.
  bool picture_due() const { return picture_due_; }
  /// Absolute: past the entry point.
  const HandTarget& target() const { return target_; }

  /// Fills all that the session knows of a message; times stay as they are.
  void Describe(torquer_lcm::wire_state_t& out) const;
  /// The same for the catheter around the wire, all else zero; false where there is none. Contacts,
  /// energy and what a replay needs stand in the wire's message.
  bool DescribeCatheter(torquer_lcm::wire_state_t& out) const;
  /// How far the wire itself reaches; where a catheter goes on beyond it, not as far as the state.
  double wire_insertion_mm() const;

 private:
  // What a tick was given, and did.
  struct Done {
    HandTarget target;
    double time_s;
    int work;
  };

  void DescribeShape(double insertion_mm, torquer_lcm::wire_state_t& out) const;
  void Observe();
  void RunEffects(double step_s, const effects::Controls& controls);

  scene::Scene& scene_;
  std::unique_ptr<Relaxation> relaxation_;
  std::vector<effects::Evolution*> evolutions_;
  std::vector<effects::Observer*> observers_;
  effects::ImageSource* image_ = nullptr;
  bool picture_due_ = false;
  bool lives_ = false;
  WireState state_;
  TickReport report_;
  double time_s_ = 0;
  HandTarget target_;
  std::deque<Done> done_;  // the newest first
  std::int64_t command_sequence_ = -1;
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
