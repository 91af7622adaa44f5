// Accuracy bench: measures cases in one scene against reference solutions.
#pragma once

#include <map>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "host/simulator/core/paper/paper_relaxation.h"
#include "host/simulator/scene/scene.h"
#include "host/study/wire_comparison.h"

namespace torquer::study {

/// Relaxation method of a case.
enum class AccuracyMethod {
  kNewtonTolerance,  ///< each action until a residual tolerance
  kNewtonBudget,     ///< each action for a time budget
  kPaper,            ///< Tip Relaxation and cycles
};

/// Clearance field that a case uses.
enum class FieldKind {
  kScene,      ///< field of the shipped scene
  kSpline,     ///< quadratic B-splines on voxels
  kTrilinear,  ///< linear between the same distances: continuous, but with a discontinuous gradient
};

/// Setting of one case. All other parameters are those of the scene.
struct AccuracyCase {
  std::string name;
  double segment_mm = 1;
  AccuracyMethod method = AccuracyMethod::kNewtonTolerance;
  double tolerance = 1e-6;  ///< kNewtonTolerance
  double budget_us = 0;     ///< kNewtonBudget
  PaperCycles cycles = PaperCycles::kNone;
  int cycle_count = 0;  ///< cycles per action, kPaper
  UpdateRule rule = UpdateRule::kAbsolute;
  BendingLaw law = BendingLaw::kExact;
  int contact_points = 2;  ///< contact points per segment
  FieldKind field = FieldKind::kScene;
  double voxel_mm = 0;                  ///< voxel size of the case's field
  std::optional<double> friction = {};  ///< friction coefficient; the scene's if not given
  bool against_finest_field = false;    ///< the reference uses the finest field
};

struct AccuracyOutcome {
  std::vector<double> action_ms;
  double fed_mm = 0;
  int places = 0;
  int basin_changes = 0;     ///< places that end in another basin than the reference
  int unconverged = 0;       ///< number of actions that did not converge
  double error_mean_mm = 0;  ///< over places without a change of basin; NaN if there are none
  double error_max_mm = 0;
  double solver_error_mean_mm = 0;  ///< same, but against this setting solved to 1e-9
  double solver_error_max_mm = 0;
  double residual = 0;             ///< largest after the last action of a place, 1/mm
  double residual_per_length = 0;  ///< 1/mm^2, see ResidualPerLength
  double energy_gap = 0;  ///< summed energy excess over this setting solved to 1e-9, relative
  double penetration_mm = 0;
  double Quantile(double q) const;
  double MsPerMm() const;
};

class AccuracyBench {
 public:
  struct Options {
    double reference_segment_mm = 0.1;
    double finest_voxel_mm = 0.125;
    double stretch_mm = 10;  ///< length of the measured stretch at each place
  };
  /// `places_mm`: insertions, ascending, at which a measured stretch begins; multiples of 10. The
  /// wire is fed to these places with the scene's own wire and method.
  AccuracyBench(const std::string& scene_path, std::vector<double> places_mm,
                const Options& options);

  const scene::Scene& scene() const { return *scene_; }
  /// Number of references so far that did not reach their tolerance.
  int reference_unconverged() const { return reference_unconverged_; }

  /// Expected time of a case in s, from the paper's growth with n.
  double Expected(const AccuracyCase& c) const;
  AccuracyOutcome Measure(const AccuracyCase& c);

 private:
  struct Reference {
    std::unique_ptr<WireModel> model;
    std::vector<WireState> start;
    std::vector<WireState> end;
  };
  struct Companion {
    std::vector<WireState> end;
    std::vector<double> energy_mJ;
  };
  double Friction(const AccuracyCase& c) const;
  const ClearanceField& Field(FieldKind kind, double voxel_mm);
  const Reference& ReferenceFor(const AccuracyCase& c);
  const Companion& CompanionFor(const AccuracyCase& c, const Reference& reference);
  double Energy(const AccuracyCase& c, const WireModel& model, const WireState& state);
  WallModel Wall(const AccuracyCase& c) const;

  std::unique_ptr<scene::Scene> scene_;
  Options options_;
  std::vector<double> places_mm_;
  double scene_friction_ = 0;
  std::vector<WireState> approached_;
  std::map<std::string, std::unique_ptr<ClearanceField>> fields_;
  std::map<std::string, Reference> references_;
  std::map<std::string, Companion> companions_;
  int reference_unconverged_ = 0;
};

}  // namespace torquer::study
