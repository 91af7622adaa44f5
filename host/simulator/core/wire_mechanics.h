// Energy of all curves of a stack in a vessel, with its derivatives. It has each curve's energy,
// the contact between curves, and the terms of the effects.
#pragma once

#include <cstdint>
#include <optional>
#include <utility>
#include <vector>

#include "host/simulator/core/clearance_field.h"
#include "host/simulator/core/curve_mechanics.h"
#include "host/simulator/core/energy_term.h"
#include "host/simulator/core/stack/between_curves.h"
#include "host/simulator/core/stack/combined_rods.h"
#include "host/simulator/core/stack/lumen_pairs.h"
#include "host/simulator/core/wire_model.h"
#include "host/simulator/core/wire_state.h"

namespace torquer {

/// Quadratic model of the whole energy at one state. It has the data of the innermost curve, like
/// WireState, with those of the curves around it. Energy, residual and penetration are those of all
/// curves.
struct QuadraticModel : CurveQuadraticModel {
  double dissipated_mJ = 0;  ///< part of energy_mJ from terms with EnergyTerm::Dissipates
  std::vector<CurveQuadraticModel> around;  ///< of the curves around the innermost one
  std::vector<BetweenCurves> between;       ///< contact, for each of CurvePairs::of_curves

  /// Quadratic model of curve `c`, counted from the innermost.
  CurveQuadraticModel& curve(int c) { return c == 0 ? *this : around[c - 1]; }
  const CurveQuadraticModel& curve(int c) const { return c == 0 ? *this : around[c - 1]; }
};

/// Evaluates quadratic models. One per simulated wire; not thread-safe.
class WireMechanics {
 public:
  /// A lone wire. Keeps references to all; `terms` may grow only
  /// before the first evaluation.
  WireMechanics(const WireModel& model, const ClearanceField& field, const WallModel& wall,
                const std::vector<EnergyTerm*>& terms);
  /// Instruments on any number of curves.
  WireMechanics(const CombinedRods& rods, const ClearanceField& field, const WallModel& wall,
                const std::vector<EnergyTerm*>& terms);

  /// Returns a quadratic model with room for the longest wire.
  QuadraticModel MakeQuadraticModel() const;

  /// Pairs the places of curves in lumens with the curves around them. Call it after a move, and
  /// when a part of the motion begins. Has no effect without pairs.
  void PairCurves(const WireState& state);
  /// Exchanges the pairs with a second set, for a trial that shall not change them.
  void ExchangePairs() { std::swap(pairs_, trial_pairs_); }

  /// Energy, gradient and Hessian blocks with the tangent planes given by state.normals.
  void BuildModel(const WireState& state, QuadraticModel& out);
  /// Replaces the loads of a curve by those of a model. In it the wall acts only on the near points
  /// with `active`. `active` has one entry per near point. Everything else stays that of the state.
  void SumActiveLoads(const WireState& state, int curve, const std::vector<std::uint8_t>& active,
                      QuadraticModel& out) const;
  void SumActiveLoads(const WireState& state, const std::vector<std::uint8_t>& active,
                      QuadraticModel& out) const {
    SumActiveLoads(state, 0, active, out);
  }
  /// Like SumActiveLoads, for the springs between two curves. `active` has one entry per spring.
  static void SumActiveBetween(const std::vector<std::uint8_t>& active, BetweenCurves& out) {
    out.Sum([&active](std::size_t k) { return active[k] != 0; });
  }

  /// Like BuildModel, without Hessians and Hessian look-ups.
  void BuildGradient(const WireState& state, QuadraticModel& out);

  int curves() const { return static_cast<int>(curves_.size()); }
  /// True if curves are in contact with each other, or one with itself.
  bool has_pairs() const { return pairs_.has_value(); }
  /// True if some of them lie beside each other, and could pass through each other.
  bool has_beside() const;
  /// The contact points of a curve; see ContactPoints for the calls needed after a move.
  ContactPoints& points(int curve = 0) { return curves_[curve].points(); }
  const ContactPoints& points(int curve = 0) const { return curves_[curve].points(); }
  /// Number of look-ups of the field since construction.
  std::int64_t lookups() const;
  /// Takes over the memory of `twin`: look-ups and pairs.
  void CopyFrom(const WireMechanics& twin);
  /// Mixes the pairs into a hash of the state.
  std::uint64_t Hash(std::uint64_t seed) const;

  const WireModel& model(int curve = 0) const { return curves_[curve].model(); }
  const WallModel& wall() const { return wall_; }

 private:
  void BuildAll(const WireState& state, bool with_hessian, QuadraticModel& out);
  void BuildBetween(const WireState& state, QuadraticModel& out) const;
  void FindInside(const WireState& state, int curve, PointSet& points) const;
  void RelateCurves(const WireState& state, QuadraticModel& out) const;
  void AddTerms(const WireState& state, QuadraticModel& out) const;
  void AddSlideLoads(const WireState& state, QuadraticModel& out) const;
  void AddSpinGradient(int curve, int segment, int instrument, double gradient_mJ,
                       QuadraticModel& out) const;
  void SumTrueGradient(const WireState& state, QuadraticModel& out) const;
  static void SumTouches(const WireState& state, QuadraticModel& out);
  bool SlidesInLumen() const;
  BetweenCurves::Geometry GeometryOf(int curve, const WireState& state,
                                     const QuadraticModel& at) const;

  const WallModel& wall_;
  const std::vector<EnergyTerm*>& terms_;
  std::vector<CurveMechanics> curves_;
  const CombinedRods* rods_ = nullptr;  // null without pairs
  std::optional<CurvePairs> pairs_;     // empty for one curve that does not touch itself
  std::optional<CurvePairs> trial_pairs_;
};

}  // namespace torquer
