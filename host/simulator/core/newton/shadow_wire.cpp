#include "host/simulator/core/newton/shadow_wire.h"

#include <algorithm>
#include <utility>

#include "host/simulator/core/newton/move_instruments.h"

namespace torquer {

ShadowWire::ShadowWire(const InstrumentStack& stack, const ClearanceField& field,
                       const WallModel& wall, std::vector<EnergyTerm*> terms)
    : rods_(stack),
      terms_(std::move(terms)),
      mechanics_(rods_, field, wall, terms_),
      state_(rods_[0], stack.size()),
      model_(mechanics_.MakeQuadraticModel()) {}

bool ShadowWire::remembers() const {
  return std::any_of(terms_.begin(), terms_.end(),
                     [](const EnergyTerm* term) { return term->Dissipates(); });
}

void ShadowWire::Restart(const WireState& state) {
  state_ = state;
  rods_.Combine(state.poses());
  ContactPoints& points = mechanics_.points();
  points.Forget();
  points.SampleStiffness(state);
  for (EnergyTerm* term : terms_) term->Reset();
  mechanics_.BuildGradient(state_, model_);
}

void ShadowWire::BeginPart() {
  for (EnergyTerm* term : terms_) term->Begin(model_.points);
}

void ShadowWire::MovePart(const PartMotion& motion, const WireState& state) {
  for (EnergyTerm* term : terms_) {
    if (TimedTerm* timed = term->timed_term()) timed->SetMotionFraction(motion.fraction);
  }
  MoveSurfaces(rods_.stack(), motion.here, motion.next, rods_[0].spins() == 0, model_, terms_);
  rods_.Combine(motion.next);
  mechanics_.points().SampleStiffness(state);
}

void ShadowWire::EndPart() {
  for (EnergyTerm* term : terms_) term->End(model_.points);
}

void ShadowWire::Place(const WireState& state, const std::vector<Frame>& frames,
                       const CurveStep& step, double scale) {
  state_.Step(rods_[0], state, frames, step.xi, step.spin, scale);
  mechanics_.BuildGradient(state_, model_);
}

void ShadowWire::CopyFrom(const ShadowWire& twin) {
  state_ = twin.state_;
  rods_.Combine(state_.poses());
  mechanics_.CopyFrom(twin.mechanics_);
  model_ = twin.model_;
}

}  // namespace torquer
