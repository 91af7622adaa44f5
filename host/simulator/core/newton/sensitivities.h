// Sensitivities: derivatives of a state by parameters, carried along the motion (core/README.md,
// section 20).
#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <vector>

#include "host/simulator/core/newton/curve_step.h"
#include "host/simulator/core/newton/part_follower.h"
#include "host/simulator/core/newton/shadow_wire.h"
#include "host/simulator/core/wire_model.h"
#include "host/simulator/core/wire_state.h"

namespace torquer {

/// Derivatives of the states of one curve. Each parameter has two shadows of the wire, with a
/// slightly larger and a slightly smaller value. No heap after the last Add.
class Sensitivities final : public PartFollower {
 public:
  /// Reason for which a derivative is not known.
  enum class Unknown : std::uint8_t {
    kNone,         ///< it is known
    kNotAtRest,    ///< the last part of the motion has not ended
    kUnstable,     ///< the Hessian is not positive definite
    kNotSmooth,    ///< the balance has no derivative: the iteration did not converge
    kHistoryLost,  ///< one of these happened before, and terms remember the way
  };

  /// `wire`: rod of the curve; keeps a reference.
  explicit Sensitivities(const WireModel& wire);
  /// Adds a parameter with its shadows, which must outlive this. `more` has the value plus `step`,
  /// `less` the value minus `step`. `step` > 0.
  void Add(ShadowWire& more, ShadowWire& less, double step);

  void Restart(const WireState& state) override;
  void BeginPart() override;
  void MovePart(const PartMotion& motion, const WireState& state) override;
  void EndPart(const WireState& state, LinearizedBalance& balance) override;

  /// Declares that the present derivatives are not the state's. If terms remember the way, they are
  /// lost until Restart.
  void Lose();
  /// Takes over the derivatives of `twin`, with the same parameters. The shadows are copied apart.
  void CopyFrom(const Sensitivities& twin);

  std::size_t size() const { return parameters_.size(); }
  Unknown unknown(std::size_t parameter) const;
  /// Derivatives of the nodes, mm per unit of the parameter. Valid if they are known.
  const std::vector<Eigen::Vector3d>& nodes_mm(std::size_t parameter) const {
    return parameters_[parameter].nodes_mm;
  }
  /// Difference of the two shadows' values of a parameter.
  double spread(std::size_t parameter) const { return 2 * parameters_[parameter].step; }
  const ShadowWire& more(std::size_t parameter) const { return *parameters_[parameter].more; }
  const ShadowWire& less(std::size_t parameter) const { return *parameters_[parameter].less; }

 private:
  struct Parameter {
    ShadowWire* more = nullptr;
    ShadowWire* less = nullptr;
    double step = 0;
    CurveStep derivative;
    std::vector<Eigen::Vector3d> nodes_mm;
    Unknown unknown = Unknown::kNone;
  };

  void Clear(std::size_t segments, Parameter& parameter) const;
  void PlaceShadows(const WireState& state, const std::vector<Frame>& frames, Parameter& of);
  bool Find(const WireState& state, LinearizedBalance& balance, Parameter& of);
  double LongestMm(const WireState& state, const std::vector<Frame>& frames,
                   const CurveStep& step) const;
  void TakeNodes(const WireState& state, const std::vector<Frame>& frames, Parameter& of) const;

  const WireModel& wire_;
  std::vector<Parameter> parameters_;
  CurveStep gradient_;  // work space: derivative of the gradient by the parameter
  bool remembers_ = false;
  bool ended_ = true;  // the last part has ended
};

}  // namespace torquer
