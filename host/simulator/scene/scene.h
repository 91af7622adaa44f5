// A scene: the vessel, the wire and just the effects that a file calls for.
#pragma once

#include <Eigen/Core>
#include <Eigen/Geometry>
#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "host/simulator/core/clearance_field.h"
#include "host/simulator/core/coaxial/coaxial_relaxation.h"
#include "host/simulator/core/newton/newton_relaxation.h"
#include "host/simulator/core/paper/paper_relaxation.h"
#include "host/simulator/core/wire_mechanics.h"
#include "host/simulator/core/wire_model.h"
#include "host/simulator/core/wire_state.h"
#include "host/simulator/effects/effect.h"
#include "host/simulator/vessel/centerline.h"
#include "host/simulator/vessel/mesh_vessel.h"
#include "host/simulator/vessel/moving_field.h"
#include "host/simulator/vessel/patient_axes.h"

namespace torquer::scene {

using vessel::PatientAxes;

/// How a vessel came to be, for people and for the relaxation.
struct Vessel {
  std::shared_ptr<const ClearanceField> field;
  std::shared_ptr<const vessel::MeshVessel> surface;  ///< where it came from, if from a surface
  vessel::CenterlineNetwork centerlines;              ///< may be empty for surfaces
  Eigen::AlignedBox3d bounds_mm;
  std::string description;            ///< one line
  std::vector<std::string> findings;  ///< what was found and mended, one sentence each
};

enum class Method { kNewton, kPaper };

/// Everything that a scene file says, built and checked. Immovable: its parts refer to each other.
class Scene {
 public:
  /// Reads and builds a scene. Throws UserError naming file, line, key, value and remedy.
  explicit Scene(const std::string& path);
  Scene(const Scene&) = delete;
  Scene& operator=(const Scene&) = delete;

  const std::string& path() const { return path_; }
  const std::string& name() const { return name_; }
  const Vessel& vessel() const { return vessel_; }
  const PatientAxes& axes() const { return axes_; }
  /// The wire; with a catheter around it the rod that they are together.
  const WireModel& wire() const { return coaxial_ != nullptr ? coaxial_->rod() : *wire_; }
  /// Null without a catheter.
  CoaxialPair* coaxial() { return coaxial_.get(); }
  const CoaxialPair* coaxial() const { return coaxial_.get(); }
  /// The same wire cut otherwise, for comparisons. Throws std::invalid_argument as WireModel does.
  std::unique_ptr<WireModel> MakeWire(double segment_mm, BendingLaw law) const;
  const WallModel& wall() const { return wall_; }
  Method method() const { return method_; }
  double budget_us() const { return budget_us_; }     ///< of a tick in real time
  int budget_units() const { return budget_units_; }  ///< of a tick of a script
  double inserted_at_start_mm() const { return inserted_at_start_mm_; }
  double catheter_at_start_mm() const { return catheter_at_start_mm_; }
  const std::vector<std::string>& effect_names() const { return effect_names_; }
  /// In the order in which they were made; one for every name but those that only shape the wire.
  const std::vector<std::unique_ptr<effects::Effect>>& effects() const { return effects_; }
  /// The vessel as it moves; null where it does not.
  vessel::MovingField* moving_field() { return moving_.get(); }
  /// FNV-1a of the scene file and of the files that it names.
  std::uint64_t content_hash() const { return content_hash_; }

  /// A relaxation with this scene's method, wall and effects. One at a time: effects remember.
  std::unique_ptr<Relaxation> MakeRelaxation();
  /// Where the instruments are at the start.
  HandTarget start() const { return {inserted_at_start_mm_, 0, catheter_at_start_mm_, 0}; }
  /// The wire at the start: nothing inserted, or laid along the path and relaxed.
  WireState MakeStart(Relaxation& relaxation) const;

 private:
  // The wire of the file, before it is cut into segments.
  struct WireParts {
    double max_length_mm = 0;
    double tip_mm = 0;
    double tip_angle_rad = 0;
    double radius_mm = 0;
    std::vector<double> from_tip_mm = {0};
    std::vector<double> rigidity_N_mm2;  // at from_tip_mm
    std::vector<WireSection> sections;   // if not empty, instead of all but the lengths
    std::vector<effects::ShapeChange> shapes;
    Sheath sheath;
  };

  void ReadAxes(StrictTable& file);
  void ReadWire(StrictTable& file);
  void ReadShape(StrictTable& file, StrictTable& wire, double segment_mm);
  void ReadPlainWire(StrictTable& wire, double segment_mm);
  std::vector<WireSection> Sections(double segment_mm) const;
  void ReadCatheter(StrictTable& file, double segment_mm, BendingLaw law);
  void ReadRelaxation(StrictTable& file);
  void ReadEffects(StrictTable& file);
  void MakeEffect(const effects::EffectKind& kind, StrictTable& effects);
  Sheath ReadEntry(StrictTable& file);
  void CheckFit(double radius_mm, const Sheath& sheath, const StrictTable& entry) const;

  std::string path_;
  std::string name_;
  std::uint64_t content_hash_ = 0;
  Vessel vessel_;
  PatientAxes axes_;
  WallModel wall_;
  WireParts parts_;
  std::unique_ptr<WireModel> wire_;
  std::unique_ptr<CoaxialPair> coaxial_;
  std::vector<Eigen::Vector3d> start_path_mm_;
  double inserted_at_start_mm_ = 0;
  double catheter_at_start_mm_ = 0;
  double catheter_inner_mm_ = 0;
  Method method_ = Method::kNewton;
  NewtonSettings newton_;
  PaperSettings paper_;
  double budget_us_ = 700;
  int budget_units_ = 1000;
  std::vector<std::unique_ptr<effects::Effect>> effects_;
  std::vector<std::string> effect_names_;
  std::vector<EnergyTerm*> terms_;
  std::unique_ptr<vessel::MovingField> moving_;
};

}  // namespace torquer::scene
