// Energy term: the interface by which an effect adds to the energy of the wire.
#pragma once

#include <array>
#include <cstdint>

#include "host/simulator/core/instrument_pose.h"
#include "host/simulator/core/point_derivatives.h"
#include "host/simulator/core/point_set.h"

namespace torquer {

/// Motion of an instrument's surface, driven by its hand, relative to the points.
struct SurfaceMove {
  double along_mm = 0;  ///< along its curve, distally if positive
  double turn_rad = 0;  ///< about the tangent, right-handed
};

struct Sliding;

/// Role *contact* of an energy term: it acts between surfaces, as friction does.
class ContactTerm {
 public:
  virtual ~ContactTerm() = default;
  /// Moves the surfaces of the instruments relative to the points, before the points move. This
  /// applies to instruments that slide within each other, and to instruments that turn without
  /// twist.
  virtual void MoveSurfaces(const PointSet& points,
                            const std::array<SurfaceMove, kMostInstruments>& moves) = 0;
  /// True if its forces act where the wire's surface touches the wall. They then also turn the wire
  /// about its axis and count as contact forces.
  virtual bool ActsOnWall() const = 0;
};

/// Role *timed* of an energy term: it depends on the time of a tick.
class TimedTerm {
 public:
  virtual ~TimedTerm() = default;
  /// Sets the fraction, 0 .. 1, of the remaining motion that the current part covers. The part has
  /// the same fraction of the remaining time. Not called if no motion remains; the fraction is
  /// then 1.
  virtual void SetMotionFraction(double fraction) = 0;
};

/// Role *between* of an energy term: it acts between instruments.
class BetweenTerm {
 public:
  virtual ~BetweenTerm() = default;
  /// Sliding between the instruments of a curve. The term needs PointSet::Between::pressed_N.
  virtual const Sliding& sliding() const = 0;
  /// True if the term depends on the relative sliding of the surfaces of curves. It then needs
  /// PointSet::Between::lumen.
  virtual bool SlidesInLumen() const = 0;
};

/// Role *energy term*: an energy of the wire's points and tangents and, if it twists, of its
/// normals. It may couple the unknowns of one point and its spin, but no other two unknowns. Its
/// gradient must be continuous. Its Hessian may be replaced by a positive semidefinite
/// approximation. Every call with a PointSet is made for each curve, from the innermost outwards.
class EnergyTerm {
 public:
  EnergyTerm() = default;
  EnergyTerm(const EnergyTerm&) = delete;
  EnergyTerm& operator=(const EnergyTerm&) = delete;
  virtual ~EnergyTerm() = default;

  /// Called before a part of the motion, and after a move of the vessel. Stores the state that
  /// stays constant while that part is relaxed. The wire is in equilibrium, or nearly.
  virtual void Begin(const PointSet& points) = 0;
  /// True if the result of Add is not stored in the wire: dissipated work, or terms of a time step.
  /// It counts when the wire is relaxed, but not as the wire's energy.
  virtual bool Dissipates() const { return false; }
  /// Returns the energy, mJ, and adds its derivatives to `out`.
  virtual double Add(const PointSet& points, PointDerivatives& out) const = 0;
  /// Called after that relaxation: updates the term's memory, such as anchors.
  virtual void End(const PointSet& points) = 0;
  /// Clears the term's memory, as at the start of a session.
  virtual void Reset() = 0;
  /// Mixes the term's memory into a hash of the state.
  virtual std::uint64_t Hash(std::uint64_t seed) const = 0;

  /// Further roles of the term; null for roles that it does not have.
  virtual ContactTerm* contact_term() { return nullptr; }
  virtual TimedTerm* timed_term() { return nullptr; }
  virtual BetweenTerm* between_term() { return nullptr; }
};

}  // namespace torquer
