// Outlets of the vessel. An instrument that reaches one leaves the model. It is held there, as if
// its next part were in the vessels behind.
#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <vector>

#include "host/simulator/core/instrument_pose.h"
#include "host/simulator/effects/effect.h"
#include "host/simulator/vessel/outlets.h"

namespace torquer::effects {

/// Holds instruments at the outlets. Further pushing is carried. The instrument follows again when
/// the hand is back at the insertion at which the instrument left.
class Outlets final : public Effect, public Observer, public MotionLimit {
 public:
  /// `distance_mm`: from an outlet's disc, in addition to the instrument's radius, at which the
  /// instrument leaves the model. The outlet behind an instrument's entry is none for it. `stack`
  /// and `moving` (null for a vessel at rest) must outlive this.
  Outlets(std::vector<vessel::Outlet> outlets, double distance_mm, const InstrumentStack& stack,
          const vessel::MovingField* moving);

  Observer* observer() override { return this; }
  MotionLimit* limit() override { return this; }
  void Restart() override;
  void CopyFrom(const Effect& twin) override;
  void Observe(const TickView& tick) override;
  std::vector<Reading> Readings() const override;

  void Hold(InstrumentPoses& target) const override;
  bool Limit(const WireState& state, InstrumentPoses& target) const override;
  void Look(const WireState& state) override;
  bool left_model() const override;
  std::uint64_t Hash(std::uint64_t seed) const override;

  const std::vector<vessel::Outlet>& outlets() const { return outlets_; }

 private:
  double NearestMm(int instrument, const WireState& state) const;

  const std::vector<vessel::Outlet> outlets_;
  const double distance_mm_;
  const InstrumentStack& stack_;
  const vessel::MovingField* const moving_;
  std::array<int, kMostInstruments> own_{};  // outlet behind the entry; -1: none
  // Insertion at which an instrument left the model; empty: it is inside.
  std::array<std::optional<double>, kMostInstruments> held_mm_;
  bool was_out_ = false;
  double beyond_mm_ = 0;
  int events_ = 0;
  std::optional<double> event_s_;  // of the newest event
};

EffectKind OutletsKind();

}  // namespace torquer::effects
