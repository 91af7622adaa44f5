// The environment of torquer.envs without Python: moves hands, observes and judges the result.
#pragma once

#include <torquer/torquer.h>

#include <array>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <string>
#include <vector>

#include "host/support/usage.h"

namespace torquer::python {

/// Values of torquer.envs.Task.
struct NavigationTask {
  std::size_t instrument = 0;
  double within_mm = 0;
  double step_s = 0;
  double longest_mm = 0;
  double largest_turn_rad = 0;
  double force_limit_mN = 0;
  int max_steps = 0;
  bool pictures = false;     ///< true if X-ray is on
  std::vector<Point> route;  ///< points from the entry to the target, 1 mm apart
};

/// Start of an episode.
struct NavigationStart {
  double rotation_rad = 0;        ///< of the task's instrument
  std::vector<Point> route = {};  ///< as in the task; empty: the task's value
};

/// Results of a step or a reset; numpy sees them as the rows of an array. NaN: not known.
/// kWallForce_mN is NaN in a step that did not converge. So is kSafeSuccess if it depends on one.
enum class Fact {
  kReward,
  kTerminated,
  kTruncated,
  kSuccess,
  kSafeSuccess,
  kWallForce_mN,
  kPath_mm,
  kRemaining_mm,
  kTime_s,
};
/// Names of the facts, in their order.
inline constexpr std::array kFactNames = {"reward",  "terminated",   "truncated",
                                          "success", "safe_success", "wall_force_mN",
                                          "path_mm", "remaining_mm", "time_s"};
inline constexpr std::size_t kFacts = kFactNames.size();
static_assert(kFacts == static_cast<std::size_t>(Fact::kTime_s) + 1);

/// Memory of an environment, beside its simulation.
struct NavigationMemory {
  std::vector<Point> route;  ///< of the episode
  Point tip = {};
  std::size_t nearest = 0;  ///< index of the nearest point of the route
  bool begun = false;       ///< true after the first reset
  int steps = 0;
  double worst_mN = 0;       ///< in steps that converged
  bool any_unknown = false;  ///< true after a start or a step that did not converge
  std::array<double, kFacts> facts = {};
};

/// An environment at a moment, to store it.
struct NavigationState {
  std::string simulation;  ///< of Simulation::Save
  NavigationMemory memory;
};

/// Runs episodes in turn. Only one thread may use it at a time; a second one is refused.
class Navigation {
 public:
  using AfterTick = std::function<bool(const StepReport& tick)>;

  /// `scene` needs [effects.wall_force], and makes pictures if the task has them.
  Navigation(const Scene& scene, NavigationTask task);
  /// A copy continues on its own.
  Navigation(const Navigation& other);
  Navigation& operator=(const Navigation&) = delete;
  ~Navigation() = default;

  const NavigationTask& task() const { return task_; }
  NavigationState Save() const;
  /// Takes over a state of an environment with the same scene and task. Refuses others, and damaged
  /// ones. `after_tick`: as in Simulation::Load.
  void Load(const NavigationState& state, const std::function<void()>& after_tick = {});

  std::size_t action_size() const { return 2 * instruments_; }
  std::size_t vector_size() const;

  /// Returns to the start, turns the task's instrument, and makes a step. `after_tick`: as in
  /// Simulation::Step.
  void Reset(const NavigationStart& start, const AfterTick& after_tick = {});
  /// `action`: feed and turn of each instrument, -1 .. 1 as fractions of the task's limits. Throws
  /// for values that are not finite, before the first reset, and after the end of an episode.
  void Step(const double* action, const AfterTick& after_tick = {});
  /// Throw for the arguments that Reset and Step refuse.
  static void CheckStart(const NavigationStart& start);
  void CheckAction(const double* action) const;
  std::array<double, kFacts> facts() const;
  /// Writes vector_size() values.
  void Observe(float* out) const;
  /// Last picture; before the first one, a picture of a millisecond later.
  const Picture& TakePicture();

  Simulation& simulation() { return simulation_; }

 private:
  Navigation(const Navigation& other, const Usage<Error>::Hold& hold);
  double& fact(Fact which) { return memory_.facts[static_cast<std::size_t>(which)]; }
  Point Tip() const { return simulation_.instruments()[task_.instrument].tip_mm; }
  double Force() const;
  void FindOnRoute(std::size_t reach);
  void Conclude();
  double SafeSuccess() const;
  void Write(float* out) const;

  NavigationTask task_;
  std::size_t instruments_;
  std::vector<double> lengths_mm_;  // of each instrument
  Simulation simulation_;
  const Simulation start_;
  Picture first_picture_;
  NavigationMemory memory_;
  mutable Usage<Error> usage_;
};

}  // namespace torquer::python
