#include "host/study/segments.h"

#include <algorithm>
#include <cmath>
#include <random>
#include <string>
#include <vector>

#include "host/simulator/scene/scene.h"
#include "host/simulator/simulation.h"
#include "host/study/cpu_time.h"

namespace torquer::study {
namespace {

using simulator::Command;
using simulator::Simulation;

// The reference has segments that are this many times as short. So its nodes coincide with those of
// the scene, counted from the tip.
constexpr int kFiner = 4;
// Motion whose error is not that of a converging method: the wires lie in different shapes.
constexpr double kSnapMm = 2;

struct RowError {
  double estimated_mm = 0;  // NaN: unknown
  double error_mm = 0;
};

struct SceneErrors {
  std::vector<RowError> rows;
  double with_ms = 0;     // time of all rows with the estimate
  double without_ms = 0;  // and without
};

scene::SceneSpec SpecOf(const std::string& path, bool estimates, double finer) {
  scene::SceneSpec spec = scene::ReadScene(path);
  if (estimates) {
    spec = scene::ParseScene(spec.text + "\n[effects.segment_error]\n", spec.path, spec.folder);
  }
  spec.relaxation.segment_mm /= finer;
  return spec;
}

// The factor of the estimate was chosen with seeds 1 to 3.
constexpr unsigned kFirstSeed = 101;
// Rows in which the hands only advance, so that the wire lies in the bends of the vessel.
constexpr int kAdvanceRows = 40;

// Random hand motion after an advance. The outer instruments move half as far.
class RandomHands {
 public:
  RandomHands(const scene::Scene& scene, unsigned seed)
      : scene_(scene), target_(scene.start()), random_(seed) {}
  Command Next() {
    const bool advances = row_++ < kAdvanceRows;
    std::uniform_real_distribution<double> feed_mm(advances ? 2 : -2, advances ? 4 : 3);
    std::uniform_real_distribution<double> turn_rad(-0.5, 0.5);
    for (int k = 0; k < target_.size(); ++k) {
      const double most_mm = scene_.stack().instrument(k).max_length_mm();
      const double to_mm = target_[k].insertion_mm + feed_mm(random_) / (k == 0 ? 1 : 2);
      target_[k].insertion_mm = std::clamp(to_mm, 0.0, most_mm);
      target_[k].rotation_rad += turn_rad(random_);
    }
    time_s_ += 0.2;
    Command command;
    command.target = target_;
    command.time_s = time_s_;
    return command;
  }

 private:
  const scene::Scene& scene_;
  InstrumentPoses target_;
  double time_s_ = 0;
  int row_ = 0;
  std::mt19937 random_;
};

double ErrorMm(const WireState& state, const WireState& reference) {
  double largest_mm = 0;
  for (int c = 0; c < state.curves(); ++c) {
    const std::vector<Eigen::Vector3d>& nodes = state.curve(c).nodes();
    const std::vector<Eigen::Vector3d>& finer = reference.curve(c).nodes();
    for (std::size_t back = 0; back + 1 < nodes.size() && kFiner * back + 1 < finer.size();
         ++back) {
      const Eigen::Vector3d apart =
          nodes[nodes.size() - 1 - back] - finer[finer.size() - 1 - kFiner * back];
      largest_mm = std::max(largest_mm, apart.norm());
    }
  }
  return largest_mm;
}

double EstimateMm(const Simulation& simulation) {
  for (const effects::Reading& reading : simulation.Readings()) {
    if (reading.name == "segment_error_mm") return reading.value;
  }
  return std::nan("");
}

double TickMs(Simulation& simulation, const Command& command) {
  CountedBudget budget(simulation.scene().budget_units());
  const double start_s = ThreadCpuSeconds();
  simulation.Tick(command, budget);
  return 1e3 * (ThreadCpuSeconds() - start_s);
}

SceneErrors Measure(const std::string& path, unsigned seed, int rows) {
  scene::Scene plain(SpecOf(path, false, 1));
  scene::Scene estimating(SpecOf(path, true, 1), plain);
  scene::Scene fine(SpecOf(path, false, kFiner), plain);
  Simulation without(plain);
  Simulation with(estimating);
  Simulation reference(fine);
  RandomHands hands(plain, seed);
  SceneErrors errors;
  for (int k = 0; k < kAdvanceRows + rows; ++k) {
    const Command command = hands.Next();
    // First, so that it builds the shared parts of the field, which count for neither time.
    CountedBudget budget(kFiner * plain.budget_units());
    reference.Tick(command, budget);
    errors.without_ms += TickMs(without, command);
    errors.with_ms += TickMs(with, command);
    if (k < kAdvanceRows || !reference.at_rest() || !with.at_rest()) continue;
    errors.rows.push_back({EstimateMm(with), ErrorMm(with.state(), reference.state())});
  }
  return errors;
}

double Quantile(std::vector<double> values, double q) {
  if (values.empty()) return std::nan("");
  std::sort(values.begin(), values.end());
  const double at = q * static_cast<double>(values.size() - 1);
  return values[static_cast<std::size_t>(std::lround(at))];
}

class SegmentsStudy final : public Study {
 public:
  std::string name() const override { return "segments"; }
  std::string title() const override { return "Estimated and true error by the segments"; }
  std::string summary() const override {
    return "segment_error, compared with the error against segments a quarter as long";
  }
  void AddOptions(Options& options) override {
    options.Text("--scenes", "FOLDER", scenes_, "folder of the scenes; default: the shipped ones",
                 ValueKind::kFolder);
  }

  bool Run(StudyRun& run) override {
    const std::string folder = SceneFolder(scenes_);
    std::vector<std::string> names = {"drill_tube", "ty_phantom", "abdominal_aorta", "neuro_arch"};
    if (!run.quick()) {
      names.insert(names.end(), {"coronary", "triaxial", "buddy_wire", "calcified"});
    }
    run.Section("Random hand motion in shipped scenes");
    run.Say(
        "The estimate is [effects.segment_error]. The true error is the largest distance of a node "
        "from its place in a run of the same history, with segments a quarter as long. In rows "
        "with an error above 2 mm, the wires lie in different shapes.");
    run.Say("Before the rows that count, the hands advance by 120 mm.");
    table_ = {.caption = "Estimated and true error of a node",
              .header = {"scene", "rows", "known", "error p50 mm", "p95", "estimate p50", "p95",
                         "covered", "above 2 mm", "announced", "time"},
              .rows = {}};
    const unsigned seeds = run.quick() ? 1 : 3;
    SceneErrors all;
    for (const std::string& name : names) {
      RequireScene(folder, name);
      SceneErrors sum;
      for (unsigned seed = kFirstSeed; seed < kFirstSeed + seeds; ++seed) {
        Add(Measure(folder + "/" + name + ".toml", seed, run.quick() ? 20 : 60), sum);
      }
      Show(name, sum, run);
      Add(sum, all);
    }
    Show("all", all, run);
    run.Show(table_);
    return true;
  }

 private:
  static void Add(const SceneErrors& part, SceneErrors& sum) {
    sum.rows.insert(sum.rows.end(), part.rows.begin(), part.rows.end());
    sum.with_ms += part.with_ms;
    sum.without_ms += part.without_ms;
  }

  void Show(const std::string& name, const SceneErrors& of, StudyRun& run) {
    std::vector<double> errors;
    std::vector<double> estimates;
    int covered = 0;
    int snaps = 0;
    int announced = 0;
    for (const RowError& row : of.rows) {
      if (!std::isfinite(row.estimated_mm)) continue;
      errors.push_back(row.error_mm);
      estimates.push_back(row.estimated_mm);
      covered += row.error_mm <= row.estimated_mm;
      snaps += row.error_mm > kSnapMm;
      announced += row.error_mm > kSnapMm && row.estimated_mm > kSnapMm;
    }
    const auto known = static_cast<double>(errors.size());
    const double ratio = of.with_ms / of.without_ms;
    const double share = covered / known;
    run.Record(name, "rows", static_cast<double>(of.rows.size()), "");
    run.Record(name, "known", known, "");
    run.Record(name, "error_p50", Quantile(errors, 0.5), "mm");
    run.Record(name, "error_p95", Quantile(errors, 0.95), "mm");
    run.Record(name, "estimate_p50", Quantile(estimates, 0.5), "mm");
    run.Record(name, "estimate_p95", Quantile(estimates, 0.95), "mm");
    run.Record(name, "covered", share, "");
    run.Record(name, "snaps", snaps, "");
    run.Record(name, "announced", announced, "");
    run.Record(name, "time_ratio", ratio, "");
    table_.rows.push_back({name, Number(static_cast<double>(of.rows.size())), Number(known),
                           Number(Quantile(errors, 0.5)), Number(Quantile(errors, 0.95)),
                           Number(Quantile(estimates, 0.5)), Number(Quantile(estimates, 0.95)),
                           Number(share), Number(snaps), Number(announced), Number(ratio)});
  }

  std::string scenes_;
  Table table_;
};

}  // namespace

std::unique_ptr<Study> MakeSegmentsStudy() { return std::make_unique<SegmentsStudy>(); }

}  // namespace torquer::study
