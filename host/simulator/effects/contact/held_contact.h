// Held contact: memory of friction at a place between two curves (core/README.md, section 18).
#pragma once

#include <Eigen/Core>
#include <array>
#include <cstdint>

#include "host/simulator/core/energy_term.h"
#include "host/simulator/core/point_derivatives.h"
#include "host/simulator/core/point_set.h"

namespace torquer::effects {

/// Anchor of a place. It moves with the inner curve.
class HeldContact {
 public:
  /// Begins a part at a contact: stores it, with its direction around and the limit mu N.
  void Begin(const LumenContact& contact, double coefficient);
  /// Load of the place without its number. Returns the energy, mJ; 0 without friction.
  double Add(const LumenContact& contact, double slip_mm, SlideLoad& load) const;
  /// Moves the surfaces, which turn with their hands, against each other.
  void MoveSurfaces(const std::array<SurfaceMove, kMostInstruments>& moves);
  /// Ends a part: the anchor follows a place that has slipped.
  void End(const LumenContact& contact, double slip_mm);
  /// Takes over the sliding from another place of the same surfaces.
  void Inherit(const HeldContact& other) { slid_mm_ = other.slid_mm_; }

  bool is_held() const { return limit_N_ > 0; }
  /// True if the surfaces are still those of the part's start, and there is friction.
  bool Holds(const LumenContact& contact) const;
  const LumenContact& from() const { return from_; }
  std::uint64_t Hash(std::uint64_t seed) const;

 private:
  // True if the place faced another segment of the lumen at the part's start. The directions around
  // the lumen then have no common zero, so it does not slide around until the part ends.
  bool Changed(const LumenContact& contact) const {
    return contact.outer_from_tip != from_.outer_from_tip;
  }
  bool IsBeside() const { return from_.lever_mm < 0; }
  Eigen::Vector3d LeverMm() const;
  Eigen::Vector3d LeverMm(const LumenContact& contact) const;
  Eigen::Vector2d SlidMm(const LumenContact& contact) const;
  Eigen::Vector2d SlidBesideMm(const LumenContact& contact) const;

  Eigen::Vector2d slid_mm_ = Eigen::Vector2d::Zero();  // since the anchor: along, around
  double limit_N_ = 0;                                 // mu N at the part's start; 0: no friction
  LumenContact from_;                                  // the contact at the part's start
  Eigen::Vector2d around_ = Eigen::Vector2d::Zero();   // unit, in the normals of the lumen
};

}  // namespace torquer::effects
