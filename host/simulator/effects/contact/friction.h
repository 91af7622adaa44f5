// Coulomb friction of the wire on the wall.
//
// Spots of each instrument's surface have anchors on the wall. Spots are as far apart as the
// contact points and fixed to the instrument's material. Here s is the displacement of a spot from
// its anchor in the plane of contact. N is the normal force at the start of the part. The force is
// that of StickSlip with the limit mu N. After the part, an anchor farther away than the slip
// length d follows to the distance d. So the force stays unchanged, and the contact does not creep
// while it sticks.
//
// A part is the motion that the relaxation performs at once (0.25 mm). So the wire's path does not
// depend on the length of a tick or the end of its budget. The surface slides: a turn moves it
// around, a feed moves it along, and both share one cone. If the vessel moves, the anchors move
// with their places on the wall.
//
// The spots of the leader are the contact points of the rod. Spots of other instruments lie between
// them and share the contact forces of the points on either side.
//
//   contact points, moving with the leader      |------o------|------o------|--->
//   spots of a catheter at rest around it           x------x------x------x
#pragma once

#include <memory>
#include <vector>

#include "host/simulator/effects/effect.h"
#include "host/simulator/effects/values_along.h"
#include "host/simulator/vessel/region.h"

namespace torquer::effects {

class Friction final : public Effect, public EnergyTerm, public ContactTerm {
 public:
  /// Part of the vessel whose wall multiplies the coefficient.
  struct RegionFactor {
    vessel::Region region;
    double factor = 1;  ///< >= 0
  };
  /// `coefficient`: mu in [0, 2] of instruments without their own; `slip_mm`: d in [1e-5, 0.1].
  /// Later parts override earlier ones.
  Friction(double coefficient, double slip_mm, const EffectContext& context,
           std::vector<RegionFactor> regions = {});

  EnergyTerm* energy_term() override { return this; }
  ContactTerm* contact_term() override { return this; }
  void CopyFrom(const Effect& twin) override;

  bool Dissipates() const override { return true; }
  bool ActsOnWall() const override { return true; }

  void Begin(const PointSet& points) override;
  double Add(const PointSet& points, PointDerivatives& out) const override;
  void MoveSurfaces(const PointSet& points,
                    const std::array<SurfaceMove, kMostInstruments>& moves) override;
  void End(const PointSet& points) override;
  void Reset() override;
  std::uint64_t Hash(std::uint64_t seed) const override;

 private:
  struct Anchor {
    Eigen::Vector3d at = Eigen::Vector3d::Zero();
    Eigen::Vector3d at_rest = Eigen::Vector3d::Zero();  // same place in the vessel at rest
    Eigen::Vector3d normal = Eigen::Vector3d::Zero();   // unit, of the wall, at the part's start
    double limit_N = 0;                                 // mu N at the part's start
    bool holds = false;
  };

  // Contact force of a spot on the wall.
  struct Press {
    Eigen::Vector3d normal_N = Eigen::Vector3d::Zero();  // along the wall's normal
    double limit_N = 0;                                  // mu times normal_N
    bool touches = false;
  };

  // Spots of the instruments on a curve.
  struct Spots {
    std::vector<std::size_t> pressed;  // those with a contact force; set by FindPresses
    std::vector<std::size_t> holding;  // those with a valid anchor
    std::vector<std::size_t> acting;   // those of `holding` with a limit in this part
  };

  // Position of a spot's segment at the part's start, for an instrument that twists.
  struct LocalFrame {
    Eigen::Vector3d tangent;
    Eigen::Vector3d normal;
  };
  // Displacement of the surface since the part's start, due to the instrument's turn about its
  // axis.
  struct RollingSlip {
    double angle_rad = 0;
    Eigen::Vector3d per_rad_mm = Eigen::Vector3d::Zero();  // displacement of the surface
    // Derivative of the angle with respect to the tangent.
    Eigen::Vector3d area = Eigen::Vector3d::Zero();
  };

  // Spots are numbered from the tip of the innermost instrument, then from that of the next one.
  int InstrumentOf(std::size_t spot) const { return static_cast<int>(spot / stride_); }
  Spots& SpotsOn(const PointSet& points) {
    return on_curves_[static_cast<std::size_t>(points.among.curve)];
  }
  PointSet::Place PlaceOf(const PointSet& points, std::size_t spot) const;
  void FindPresses(const PointSet& points);
  void PressSpots(const PointSet& points, int q, int instrument, const Eigen::Vector3d& normal_N);
  LocalFrame LocalFrameOf(const PointSet& points, std::size_t spot, int point) const;
  RollingSlip RollingSlipAt(const PointSet& points, std::size_t spot, int point,
                            const Eigen::Vector3d& normal) const;
  double CoefficientAt(const PointSet& points, int q, int instrument) const;
  void Place(const Eigen::Vector3d& at, Anchor& anchor) const;

  const double slip_mm_;
  std::vector<ValuesAlong> coefficients_;  ///< of each instrument
  const std::vector<RegionFactor> regions_;
  const vessel::MovingField* const moving_;  ///< null for a vessel at rest
  std::size_t stride_;                       ///< number of spots of an instrument
  std::vector<Anchor> anchors_;
  std::vector<LocalFrame> local_frames_;  ///< by spot; empty without twist
  std::vector<Press> presses_;            ///< by spot; set by FindPresses
  std::vector<Spots> on_curves_;          ///< by curve
};

EffectKind FrictionKind();

}  // namespace torquer::effects
