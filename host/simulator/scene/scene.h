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
#include "host/simulator/core/newton/newton_relaxation.h"
#include "host/simulator/core/paper/paper_relaxation.h"
#include "host/simulator/core/wire_mechanics.h"
#include "host/simulator/core/wire_model.h"
#include "host/simulator/core/wire_state.h"
#include "host/simulator/effects/effect.h"
#include "host/simulator/vessel/centerline.h"
#include "host/simulator/vessel/mesh_vessel.h"

namespace torquer::scene {

/// Directions of the patient in the vessel's frame, unit and orthogonal.
struct PatientAxes {
  Eigen::Vector3d left{1, 0, 0};
  Eigen::Vector3d posterior{0, 1, 0};
  Eigen::Vector3d superior{0, 0, 1};
};

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
  const WireModel& wire() const { return *wire_; }
  /// The same wire cut otherwise, for comparisons. Throws std::invalid_argument as WireModel does.
  std::unique_ptr<WireModel> MakeWire(double segment_mm, BendingLaw law) const;
  const WallModel& wall() const { return wall_; }
  Method method() const { return method_; }
  double budget_us() const { return budget_us_; }     ///< of a tick in real time
  int budget_units() const { return budget_units_; }  ///< of a tick of a script
  double inserted_at_start_mm() const { return inserted_at_start_mm_; }
  const std::vector<std::string>& effect_names() const { return effect_names_; }
  /// FNV-1a of the scene file and of the files that it names.
  std::uint64_t content_hash() const { return content_hash_; }

  /// A relaxation with this scene's method, wall and effects. One at a time: effects remember.
  std::unique_ptr<Relaxation> MakeRelaxation();
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
    Sheath sheath;
  };

  void ReadAxes(StrictTable& file);
  void ReadWire(StrictTable& file);
  void ReadRelaxation(StrictTable& file);
  void ReadEffects(StrictTable& file);
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
  std::vector<Eigen::Vector3d> start_path_mm_;
  double inserted_at_start_mm_ = 0;
  Method method_ = Method::kNewton;
  NewtonSettings newton_;
  PaperSettings paper_;
  double budget_us_ = 700;
  int budget_units_ = 1000;
  std::vector<std::unique_ptr<effects::Effect>> effects_;
  std::vector<std::string> effect_names_;
  std::vector<EnergyTerm*> terms_;
};

}  // namespace torquer::scene
