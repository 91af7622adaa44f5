// Instruments on curves in contact: quadratic model, and the sweep against the dense Newton system.
#pragma once

#include <Eigen/Core>
#include <vector>

#include "host/simulator/core/newton/front_sweep.h"
#include "host/simulator/core/stack/combined_rods.h"
#include "host/simulator/core/stack/instrument_stack.h"
#include "host/simulator/core/wire_mechanics.h"
#include "tests/support/wires.h"

namespace torquer::test {

// Curves whose state a test lays. Keeps a reference to `field`.
struct DenseCurves {
  InstrumentStack stack;
  CombinedRods rods{stack};
  const WireModel& model = rods[0];
  WallModel wall;
  EndForce force{Vector3d(1e-4, 2e-4, 3e-4)};
  std::vector<EnergyTerm*> terms{&force};  ///< more may be added before the first evaluation
  WireState state{model, stack.size()};
  WireMechanics mechanics;
  QuadraticModel at;
  // Model of a trial state. A new one for each energy takes most of the time of a dense Hessian.
  QuadraticModel trial;

  DenseCurves(std::vector<WireModel> instruments, const Clearance& clearance,
              const ClearanceField& field, const WallModel& of_wall);

  // Pairs the curves at the state, and builds the model there.
  void Build();

  // Number of unknowns of a curve: for each segment a step, and a spin of each instrument.
  Eigen::Index Own(int curve) const {
    return (2 + rods[curve].spins()) * state.curve(curve).segments();
  }
  // First unknown of a curve.
  Eigen::Index First(int curve) const;
  Eigen::Index unknowns() const { return First(stack.curves()); }
  // State after the unknowns x.
  WireState Stepped(const Eigen::VectorXd& x) const;
  void Forget();
  double Energy(const Eigen::VectorXd& x);
  Eigen::VectorXd Gradient() const;
  // Diagonal for a weight of one.
  Eigen::VectorXd Unit() const;
  FrontSweep Sweep() const;
  // Unknowns of the steps of all curves.
  Eigen::VectorXd All(const std::vector<CurveStep>& steps) const;
  double PressedN() const;
  // True if no contact is so close to its limit that finite differences cross the kink.
  bool IsFarFromKinks() const;
};

// Compares the gradient of the model with finite differences.
void CheckGradient(DenseCurves& curves, double tolerance = 1e-7);

// Compares a step of the sweep with that of the dense Newton system.
void CheckStep(DenseCurves& curves, double weight);

}  // namespace torquer::test
