#include "host/simulator/core/newton/newton_memory.h"

#include "host/simulator/core/hash.h"

namespace torquer {

void NewtonMemory::Reserve(const WireMechanics& mechanics) {
  const int curves = mechanics.curves();
  active_sets.reserve(curves);
  feeds.reserve(curves);
  travels.reserve(curves);
  for (int c = 0; c < mechanics.curves(); ++c) {
    active_sets.emplace_back(mechanics.points(c).capacity());
    feeds.emplace_back(mechanics.model(c));
    travels.emplace_back(mechanics.model(c));
  }
}

void NewtonMemory::Forget() {
  for (ActiveSet& active_set : active_sets) active_set.Forget();
  damping.Forget();
  ForgetPredictions();
  phase = Phase::kIdle;
  part = Part::kClosed;
  moved = pushed = stable = false;
  paired = true;
  pairings = iterations_since_move = 0;
  residual_when_paired = moved_since_paired_mm = 0;
}

void NewtonMemory::Move() {
  damping.Move();
  phase = Phase::kIdle;
  moved = paired = true;
  pushed = stable = false;
  pairings = iterations_since_move = 0;
}

std::uint64_t NewtonMemory::Hash(std::uint64_t seed) const {
  // Names every member, so that a struct with another one does not compile. The scene and the state
  // determine the last three.
  const auto& [phase_now, part_now, was_moved, was_pushed, is_stable, is_paired, times_paired,
               when_paired, since_paired, iterations, contacts, damper, of_feeds, of_travels,
               travel, is_current, quadratic] = *this;
  for (const FeedPrediction& feed : of_feeds) seed = feed.Hash(seed);
  for (const TravelPrediction& one : of_travels) seed = one.Hash(seed);
  seed = damper.Hash(seed);
  seed = HashWord(static_cast<std::uint64_t>(iterations), seed);
  seed = HashWord(static_cast<std::uint64_t>(phase_now), seed);
  seed = HashWord(static_cast<std::uint64_t>(part_now), seed);
  for (const bool flag : {was_moved, was_pushed, is_stable}) seed = HashWord(flag ? 1 : 0, seed);
  if (!quadratic.between.empty()) {
    seed = HashWord(static_cast<std::uint64_t>(2 * times_paired + (is_paired ? 1 : 0)), seed);
    seed = HashDouble(since_paired, HashDouble(when_paired, seed));
  }
  // Only an unfinished iteration uses these.
  if (phase_now == Phase::kAttempting) seed = damper.HashAttempt(seed);
  if (!was_moved) return seed;
  for (const ActiveSet& of_curve : contacts) seed = of_curve.Hash(seed);
  return seed;
}

}  // namespace torquer
