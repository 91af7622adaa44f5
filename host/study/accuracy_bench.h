// One scene, its references, and a case measured against them.
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

/// How a case relaxes.
enum class AccuracyMethod {
  kNewtonTolerance,  ///< each action to a residual
  kNewtonBudget,     ///< each action for a time
  kPaper,            ///< Tip Relaxation and cycles
};

/// The vessel that a case feels.
enum class FieldKind {
  kScene,      ///< as shipped
  kSpline,     ///< quadratic B-splines on voxels
  kTrilinear,  ///< linear between the same distances: continuous, its gradient not
};

/// A setting. What it does not name is the scene's own.
struct AccuracyCase {
  std::string name;
  double segment_mm = 1;
  AccuracyMethod method = AccuracyMethod::kNewtonTolerance;
  double tolerance = 1e-6;  ///< kNewtonTolerance
  double budget_us = 0;     ///< kNewtonBudget
  PaperCycles cycles = PaperCycles::kNone;
  int cycle_count = 0;  ///< an action, kPaper
  UpdateRule rule = UpdateRule::kAbsolute;
  BendingLaw law = BendingLaw::kExact;
  int contact_points = 2;  ///< a segment
  FieldKind field = FieldKind::kScene;
  double voxel_mm = 0;                  ///< of the case's field
  std::optional<double> friction = {};  ///< coefficient; the scene's if not given
  bool against_finest_field = false;    ///< the reference has the finest field
};

struct AccuracyOutcome {
  std::vector<double> action_ms;
  double fed_mm = 0;
  int places = 0;
  int basin_changes = 0;     ///< places whose end lies in another basin than the reference's
  int unconverged = 0;       ///< actions
  double error_mean_mm = 0;  ///< of places without a change of basin; NaN when there is none
  double error_max_mm = 0;
  double solver_error_mean_mm = 0;  ///< the same against the same setting solved to 1e-9
  double solver_error_max_mm = 0;
  double residual = 0;             ///< largest after the last action of a place, 1/mm
  double residual_per_length = 0;  ///< 1/mm^2, see ResidualPerLength
  double energy_gap = 0;  ///< sum of the excess over the same setting solved to 1e-9, over its sum
  double penetration_mm = 0;
  double Quantile(double q) const;
  double MsPerMm() const;
};

class AccuracyBench {
 public:
  struct Options {
    double reference_segment_mm = 0.1;
    double finest_voxel_mm = 0.125;
    double stretch_mm = 10;  ///< that each place is measured over
  };
  /// `places_mm`: insertions, ascending, at which a measured stretch begins; multiples of 10.
  /// Approaches them with the scene's own wire and method.
  AccuracyBench(const std::string& scene_path, std::vector<double> places_mm,
                const Options& options);

  const scene::Scene& scene() const { return *scene_; }
  /// References measured so far that did not come to their tolerance.
  int reference_unconverged() const { return reference_unconverged_; }

  /// Seconds that a case is expected to take, from the paper's growth with n.
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
