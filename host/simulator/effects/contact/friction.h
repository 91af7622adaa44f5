// Coulomb friction of the wire on the wall.
//
// Spots of each instrument's surface, as far apart as the contact points and fixed to its material,
// have anchors on the wall. With s the displacement of a spot from its anchor in the plane of
// contact and N the normal force at the start of the part, the force is that of StickSlip with the
// limit mu N. After the part an anchor farther away than the slip length d follows to the distance
// d: the force stays as it is, and nothing creeps while it sticks. A part is what the relaxation
// moves at once (0.25 mm): the way of the wire does not depend on how far a tick goes or where its
// budget ends. What slides is the surface: an instrument that is turned
// moves it around as one that is fed moves it along, and both share one cone. Where the vessel
// moves, the anchors go with their places on the wall.
//
// The points of contact are those of the rod. Of the instrument that leads they are the spots.
// Those of another lie between them, and take their shares of what presses the points on either
// side.
//
//   points of contact, going with the leader    |------o------|------o------|--->
//   spots of a catheter at rest around it           x------x------x------x
#pragma once

#include <memory>
#include <vector>

#include "host/simulator/effects/effect.h"
#include "host/simulator/vessel/region.h"

namespace torquer::effects {

class Friction final : public Effect, public EnergyTerm {
 public:
  /// A part of the vessel whose wall multiplies the coefficient.
  struct Part {
    vessel::Region region;
    double factor = 1;  ///< >= 0
  };
  /// `coefficient` mu in [0, 2] of instruments that have none; `slip_mm` d in [1e-5, 0.1]. Later
  /// parts lie over earlier ones.
  Friction(double coefficient, double slip_mm, const EffectContext& context,
           std::vector<Part> parts = {});

  EnergyTerm* energy_term() override { return this; }
  void CopyFrom(const Effect& twin) override;

  bool Dissipates() const override { return true; }
  bool ActsOnSurface() const override { return true; }

  void Begin(const PointSet& points) override;
  double Add(const PointSet& points, PointDerivatives& out) const override;
  void MoveSurfaces(const PointSet& points,
                    const std::array<SurfaceMove, kMostInstruments>& moves) override;
  void End(const PointSet& points) override;
  void Reset() override;
  std::uint64_t Hash(std::uint64_t seed) const override;

 private:
  // The surface of an instrument: its coefficient, and that of its coated end.
  struct Surface {
    double coefficient = 0;
    double coating_mm = 0;
    double coating_coefficient = 0;
  };

  struct Anchor {
    Eigen::Vector3d at = Eigen::Vector3d::Zero();
    Eigen::Vector3d at_rest = Eigen::Vector3d::Zero();  // the same of the vessel at rest
    Eigen::Vector3d normal = Eigen::Vector3d::Zero();   // unit, of the wall, at the part's start
    double limit_N = 0;                                 // mu N at the part's start
    bool holds = false;
  };

  // What presses a spot onto the wall.
  struct Press {
    Eigen::Vector3d normal_N = Eigen::Vector3d::Zero();  // along the wall's normal
    double limit_N = 0;                                  // mu times that
    bool touches = false;
  };

  // Of what twists: how the spot's segment lay at the part's start.
  struct Lie {
    Eigen::Vector3d tangent;
    Eigen::Vector3d normal;
  };
  // How the surface has moved since the part's start by the instrument's turn about itself.
  struct Roll {
    double angle_rad = 0;
    Eigen::Vector3d per_rad_mm = Eigen::Vector3d::Zero();  // displacement of the surface
    // Derivative of the angle with respect to the tangent.
    Eigen::Vector3d area = Eigen::Vector3d::Zero();
  };

  // Spots are numbered from the tip of the innermost instrument, then from that of the next.
  int InstrumentOf(std::size_t spot) const { return static_cast<int>(spot / stride_); }
  PointSet::Place PlaceOf(const PointSet& points, std::size_t spot) const;
  void FindPresses(const PointSet& points);
  Lie LieOf(const PointSet& points, std::size_t spot, int point) const;
  Roll RollAt(const PointSet& points, std::size_t spot, int point,
              const Eigen::Vector3d& normal) const;
  double CoefficientAt(const PointSet& points, int q) const;
  void Place(const Eigen::Vector3d& at, Anchor& anchor) const;

  const double slip_mm_;
  std::vector<Surface> surfaces_;  ///< of each instrument
  const std::vector<Part> parts_;
  const vessel::MovingField* const moving_;  ///< null where the vessel rests
  std::size_t stride_;                       ///< spots of an instrument
  std::vector<Anchor> anchors_;
  std::vector<Lie> lies_;             ///< the same; empty where nothing twists
  std::vector<Press> presses_;        ///< the same; found by FindPresses
  std::vector<std::size_t> pressed_;  ///< the spots that have one
  std::vector<std::size_t> holding_;  ///< the spots whose anchors hold
  std::vector<std::size_t> acting_;   ///< those of them that have a limit in this part
};

EffectKind FrictionKind();

}  // namespace torquer::effects
