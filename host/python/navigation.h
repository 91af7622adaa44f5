// The environment of torquer.envs without Python: hands move, and what comes of it is observed and
// judged.
#pragma once

#include <torquer/torquer.h>

#include <array>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <vector>

#include "host/support/usage.h"

namespace torquer::python {

/// As torquer.envs.Task has it.
struct NavigationTask {
  std::size_t instrument = 0;
  double within_mm = 0;
  double step_s = 0;
  double longest_mm = 0;
  double largest_turn_rad = 0;
  double force_limit_mN = 0;
  int max_steps = 0;
  bool pictures = false;     ///< whether X-ray is on
  std::vector<Point> route;  ///< from the entry to the target, 1 mm apart
};

/// What a step or a reset has led to; numpy sees the rows of an array in their place.
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
inline constexpr std::size_t kFacts = 9;

/// An episode after another. It belongs to one thread at a time, and refuses a second.
class Navigation {
 public:
  using AfterTick = std::function<bool(const StepReport& tick)>;

  /// The scene has [effects.wall_force], and pictures where the task has.
  Navigation(const Scene& scene, NavigationTask task);

  std::size_t action_size() const { return 2 * instruments_; }
  std::size_t vector_size() const;

  /// Back to the start, with the task's instrument turned by `rotation_rad` from there.
  /// `after_tick` is that of Simulation::Step.
  void Reset(double rotation_rad, const AfterTick& after_tick = {});
  /// `action`: of each instrument feed and turn, -1 .. 1 of what the task allows.
  void Step(const double* action, const AfterTick& after_tick = {});
  /// Refuse what Reset and Step refuse.
  static void CheckRotation(double rotation_rad);
  void CheckAction(const double* action) const;
  std::array<double, kFacts> facts() const;
  /// Writes vector_size() values.
  void Observe(float* out) const;
  /// The last picture, or that of a millisecond later where none was taken yet.
  const Picture& TakePicture();

  Simulation& simulation() { return simulation_; }

 private:
  double& fact(Fact which) { return facts_[static_cast<std::size_t>(which)]; }
  Point Tip() const { return simulation_.instruments()[task_.instrument].tip_mm; }
  double Force() const;
  void FindOnRoute(std::size_t reach);
  void Conclude();
  void Write(float* out) const;

  NavigationTask task_;
  std::size_t instruments_;
  Simulation simulation_;
  const Simulation start_;
  Picture first_picture_;
  Point tip_{};
  std::size_t nearest_ = 0;  // on the route
  int steps_ = 0;
  double worst_mN_ = 0;
  std::array<double, kFacts> facts_{};
  mutable Usage<Error> usage_;
};

}  // namespace torquer::python
