#include "host/simulator/core/newton/newton_memory.h"

#include "host/simulator/core/hash.h"

namespace torquer {

void NewtonMemory::Forget() {
  active_set.Forget();
  damping.Forget();
  prediction.Forget();
  phase = Phase::kIdle;
  part = Part::kClosed;
  moved = pushed = stable = false;
  iterations_since_move = 0;
}

void NewtonMemory::Move() {
  damping.Move();
  phase = Phase::kIdle;
  moved = true;
  pushed = stable = false;
  iterations_since_move = 0;
}

std::uint64_t NewtonMemory::Hash(std::uint64_t seed) const {
  // Names every member, so that a struct with another one does not compile. The scene and the state
  // determine the last three.
  const auto& [phase_now, part_now, was_moved, was_pushed, is_stable, iterations, contacts, damper,
               feed, travel, is_current, expansion] = *this;
  seed = damper.Hash(feed.Hash(seed));
  seed = HashWord(static_cast<std::uint64_t>(iterations), seed);
  seed = HashWord(static_cast<std::uint64_t>(phase_now), seed);
  seed = HashWord(static_cast<std::uint64_t>(part_now), seed);
  for (const bool flag : {was_moved, was_pushed, is_stable}) seed = HashWord(flag ? 1 : 0, seed);
  // Only an unfinished iteration uses these.
  if (phase_now == Phase::kAttempting) seed = damper.HashAttempt(seed);
  if (was_moved) seed = contacts.Hash(seed);
  return seed;
}

}  // namespace torquer
