#include "host/study/accuracy.h"

#include <map>

#include "host/study/accuracy_bench.h"
#include "host/study/accuracy_grid.h"
#include "host/study/accuracy_report.h"

namespace torquer::study {
namespace {

struct PlacesOfScene {
  const char* scene;
  std::vector<double> places_mm;
};

// Scenes, and insertions in mm at which a stretch of 10 mm is measured.
std::vector<PlacesOfScene> Scenes(bool quick) {
  if (quick) {
    return {{"ty_phantom", {130, 220}}, {"neuro_arch", {400, 470}}, {"abdominal_aorta", {80, 160}}};
  }
  return {{"ty_phantom", {80, 130, 180, 230}},
          {"neuro_arch", {390, 420, 450, 480}},
          {"abdominal_aorta", {60, 100, 140, 180}}};
}

class AccuracyStudy final : public Study {
 public:
  std::string name() const override { return "accuracy"; }
  std::string title() const override { return "Accuracy and computing time"; }
  std::string summary() const override {
    return "error and time by segments, methods, tolerances, bending laws, fields and friction";
  }
  void AddOptions(Options& options) override {
    options.Text("--scenes", "FOLDER", folder_,
                 "folder with the scenes ty_phantom, neuro_arch and abdominal_aorta; without it "
                 "the scenes that Torquer ships",
                 ValueKind::kFolder);
  }

  bool Run(StudyRun& run) override {
    folder_ = SceneFolder(folder_);
    const std::vector<PlacesOfScene> scenes = Scenes(run.quick());
    for (const PlacesOfScene& s : scenes) RequireScene(folder_, s.scene);
    const std::vector<AccuracyCase> front = FrontCases(run.quick());
    const std::vector<AccuracyAxis> axes = AxisCases(run.quick());
    AccuracyBench::Options options;
    if (run.quick()) {
      options.reference_segment_mm = 0.2;
      options.finest_voxel_mm = 0.25;
    }
    std::map<std::string, MeasuredCases> measured;
    for (std::size_t k = 0; k < scenes.size(); ++k) {
      const std::string scene = scenes[k].scene;
      const auto progress = [&](const std::string& what, double share) {
        run.Progress(scene + ": " + what,
                     (static_cast<double>(k) + share) / static_cast<double>(scenes.size()));
      };
      progress("the way in", 0);
      AccuracyBench bench(folder_ + "/" + scene + ".toml", scenes[k].places_mm, options);
      std::vector<AccuracyCase> cases = front;
      for (const AccuracyAxis& axis : axes) {
        cases.insert(cases.end(), axis.cases.begin(), axis.cases.end());
      }
      for (std::size_t c = 0; c < cases.size(); ++c) {
        progress(cases[c].name, static_cast<double>(c) / static_cast<double>(cases.size()));
        if (bench.Expected(cases[c]) > (run.quick() ? 1.5 : 12)) {
          left_out_[cases[c].name].push_back(scene);
          continue;
        }
        Measured result{cases[c], bench.Measure(cases[c])};
        Record(run, scene + "/" + cases[c].name, result.outcome);
        measured[scene].emplace(cases[c].name, std::move(result));
      }
      run.Record(scene + "/reference", "unconverged", bench.reference_unconverged(), "");
      run.Record(scene + "/reference", "segment", options.reference_segment_mm, "mm");
    }
    ReportAccuracy(run, {axes, measured, left_out_});
    return true;
  }

 private:
  static void Record(StudyRun& run, const std::string& name, const AccuracyOutcome& o) {
    run.Record(name, "ms_p50", o.Quantile(0.5), "ms");
    run.Record(name, "ms_p99", o.Quantile(0.99), "ms");
    run.Record(name, "ms_per_mm", o.MsPerMm(), "ms/mm");
    run.Record(name, "error_mean", o.error_mean_mm, "mm");
    run.Record(name, "error_max", o.error_max_mm, "mm");
    run.Record(name, "basin_changes", o.basin_changes, "");
    run.Record(name, "solver_error_mean", o.solver_error_mean_mm, "mm");
    run.Record(name, "solver_error_max", o.solver_error_max_mm, "mm");
    run.Record(name, "residual", o.residual, "1/mm");
    run.Record(name, "residual_per_length", o.residual_per_length, "1/mm^2");
    run.Record(name, "energy_gap", o.energy_gap, "");
    run.Record(name, "penetration_max", 1e3 * o.penetration_mm, "um");
    run.Record(name, "unconverged", o.unconverged, "");
  }

  std::string folder_;
  std::map<std::string, std::vector<std::string>> left_out_;  // scenes; key: case
};

}  // namespace

std::unique_ptr<Study> MakeAccuracyStudy() { return std::make_unique<AccuracyStudy>(); }

}  // namespace torquer::study
