// Choice of the sweep that serves a scene.
#include <memory>
#include <vector>

#include "host/simulator/core/newton/newton_relaxation.h"

namespace torquer {

namespace {

template <class Wires>
std::unique_ptr<Relaxation> MakeLone(const Wires& wires, bool twists, const ClearanceField& field,
                                     const WallModel& wall, const NewtonSettings& settings,
                                     const std::vector<EnergyTerm*>& terms) {
  if (twists) {
    return std::make_unique<NewtonMethod<RiccatiSweep<TwistStage>>>(wires, field, wall, settings,
                                                                    terms);
  }
  return std::make_unique<NewtonRelaxation>(wires, field, wall, settings, terms);
}

}  // namespace

std::unique_ptr<Relaxation> MakeNewtonRelaxation(const WireModel& wire, const ClearanceField& field,
                                                 const WallModel& wall,
                                                 const NewtonSettings& settings,
                                                 const std::vector<EnergyTerm*>& terms) {
  return MakeLone(wire, wire.twists(), field, wall, settings, terms);
}

std::unique_ptr<Relaxation> MakeNewtonRelaxation(const InstrumentStack& stack,
                                                 const ClearanceField& field, const WallModel& wall,
                                                 const NewtonSettings& settings,
                                                 const std::vector<EnergyTerm*>& terms) {
  if (stack.curves() > 1 || stack.empty_rod().stack_twists() || stack.clearance().touches_itself) {
    return std::make_unique<NewtonMethod<FrontSweep>>(stack, field, wall, settings, terms);
  }
  return MakeLone(stack, stack.empty_rod().twists(), field, wall, settings, terms);
}

}  // namespace torquer
