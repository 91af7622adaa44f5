#include "host/study/effects.h"

#include <malloc.h>
#include <unistd.h>

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <fstream>
#include <map>
#include <set>
#include <string>
#include <utility>
#include <vector>

#include "host/study/cpu_time.h"
#include "host/study/effect_drive.h"
#include "host/study/instruction_count.h"
#include "host/support/error.h"

namespace torquer::study {
namespace {

using Names = std::vector<std::string>;

// A wire of 250 segments in the phantom, for all cases alike.
constexpr char kScene[] = R"(name = "effects"
[vessel]
kind = "phantom"
phantom = "ty"
wall_stiffness_N_mm2 = 0.01
[entry]
centerline = "main"
at_mm = 1
[wire]
segment_mm = 1
max_length_mm = 270
tip_mm = 10
)";
// Feeds whose instructions are counted: each takes some 5 ms.
constexpr int kCounted = 60;
constexpr int kCountedQuick = 15;

constexpr char kPlainWire[] = R"(radius_mm = 0.178
tip_angle_deg = 30
rigidity_N_mm2 = 6.35e-3
)";

// What a scene would say to have the effect, as it does here. Friction's is the paper's vessel.
const std::map<std::string, std::string>& Tables() {
  static const std::map<std::string, std::string> tables = {
      {"sections", R"([effects.sections]
from_tip_mm = [0, 10.5, 10.5, 300]
rigidities_N_mm2 = [6.35e-3]
radii_mm = [0.178]
curvatures_1_per_mm = [0.0524, 0.0524, 0, 0]
)"},
      {"torsion", "[effects.torsion]\n"},
      {"catheter", R"([effects.catheter]
max_length_mm = 250
inserted_at_start_mm = 150
inner_radius_mm = 0.3
radius_mm = 0.5
rigidity_N_mm2 = 0.02
)"},
      {"friction", "[effects.friction]\ncoefficient = 0.1\n"},
      {"compliance", R"([effects.compliance]
[[effects.compliance.region]]
centerline = "main"
from_mm = 90
to_mm = 130
radius_mm = 6
factor = 20
)"},
      {"gravity", "[effects.gravity]\nlinear_density_g_m = 0.7\n"},
      {"point_load", R"([effects.point_load]
force_mN = 0.01
force_direction = [0, 0, 1]
)"},
      {"heartbeat", R"([effects.heartbeat]
amplitude_mm = 2
direction = [0, 0, 1]
[[effects.heartbeat.region]]
center_mm = [100, 0, 0]
radius_mm = 40
)"},
      {"breathing", R"([effects.breathing]
amplitude_mm = 5
direction = [0, 1, 0]
[[effects.breathing.region]]
center_mm = [100, 0, 0]
radius_mm = 80
)"},
      {"wall_force", "[effects.wall_force]\nthreshold_mN = 0.5\n"},
      {"assessment", R"([effects.assessment]
target_centerline = "main"
target_at_mm = 280
force_limit_mN = 1
)"},
      {"flow", R"([effects.flow]
inlet = "main"
inlet_mL_s = 5
rate_per_min = 70
)"},
      {"contrast", "[effects.contrast]\nrate_mL_s = 2\n"},
      {"fluoroscopy", "[effects.fluoroscopy]\n"},
  };
  return tables;
}

std::string SceneWith(const Names& names) {
  std::string text = kScene;
  const bool shaped = std::find(names.begin(), names.end(), "sections") != names.end();
  if (!shaped) text += kPlainWire;
  for (const std::string& name : names) text += Tables().at(name);
  return text;
}

// What an effect needs besides itself comes first.
Names WithNeeds(const Names& names) {
  std::set<std::string> wanted(names.begin(), names.end());
  for (bool grown = true; grown;) {
    grown = false;
    for (const effects::EffectKind& kind : effects::AllEffects()) {
      if (wanted.count(kind.name) != 0 && *kind.needs != 0) {
        grown = wanted.insert(kind.needs).second || grown;
      }
    }
  }
  Names all;
  for (const effects::EffectKind& kind : effects::AllEffects()) {
    if (wanted.count(kind.name) != 0) all.emplace_back(kind.name);
  }
  return all;
}

std::string Joined(const Names& names) {
  std::string text;
  for (const std::string& name : names) text += (text.empty() ? "" : "+") + name;
  return text;
}

struct Price {
  double tick_ms_p50 = 0;
  double tick_ms_p99 = 0;
  double heap_bytes = 0;
  double residual = 0;
  int unconverged = 0;
};

double HeapBytes() {
  const struct mallinfo2 info = mallinfo2();
  return static_cast<double>(info.uordblks + info.hblkhd);
}

Price Measure(const std::string& scene_file, int ticks) {
  const double before = HeapBytes();
  scene::Scene scene(scene_file);
  EffectDrive drive(scene);
  Price price;
  price.heap_bytes = HeapBytes() - before;
  drive.Insert(ticks);
  std::vector<double> ms;
  for (int k = 0; k < ticks; ++k) {
    const double start_s = ThreadCpuSeconds();
    const TickReport report = drive.Feed();
    ms.push_back(1e3 * (ThreadCpuSeconds() - start_s));
    price.residual = std::max(price.residual, report.residual);
    price.unconverged += !report.converged;
  }
  std::sort(ms.begin(), ms.end());
  price.tick_ms_p50 = ms[ms.size() / 2];
  price.tick_ms_p99 = ms[ms.size() * 99 / 100];
  return price;
}

// Every pair of effects that a shipped scene names.
std::vector<Names> ShippedPairs(const std::string& scenes) {
  std::set<Names> pairs;
  for (const auto& entry : std::filesystem::directory_iterator(scenes)) {
    if (entry.path().extension() != ".toml") continue;
    StrictTable file = StrictTable::Read(entry.path().string());
    StrictTable* effects = file.OptionalTable("effects");
    if (effects == nullptr) continue;
    const Names names = WithNeeds(effects->Keys());
    for (std::size_t a = 0; a < names.size(); ++a) {
      for (std::size_t b = a + 1; b < names.size(); ++b) pairs.insert({names[a], names[b]});
    }
  }
  return {pairs.begin(), pairs.end()};
}

class EffectsStudy final : public Study {
 public:
  std::string name() const override { return "effects"; }
  std::string title() const override { return "What every effect costs"; }
  std::string summary() const override {
    return "the price list: a tick with no effect, with each, with pairs, with all";
  }
  void AddOptions(Options& options) override {
    options.Text("--scenes", "FOLDER", scenes_,
                 "folder of the scenes whose pairs of effects are measured", ValueKind::kFolder);
  }

  bool Run(StudyRun& run) override {
    if (!std::filesystem::is_directory(scenes_)) {
      throw UserError("--scenes " + scenes_ + ": there is no such folder; give that of the scenes");
    }
    const std::string folder =
        (std::filesystem::temp_directory_path() / ("torquer-effects-" + std::to_string(getpid())))
            .string();
    std::filesystem::create_directories(folder);
    std::vector<Names> cases = {{}};
    Names all;
    for (const effects::EffectKind& kind : effects::AllEffects()) {
      cases.push_back(WithNeeds({kind.name}));
      const auto excludes = [&kind](const effects::EffectKind& other) {
        return std::string(kind.name) == other.excludes;
      };
      const std::vector<effects::EffectKind>& kinds = effects::AllEffects();
      if (std::none_of(kinds.begin(), kinds.end(), excludes)) all.emplace_back(kind.name);
    }
    for (Names& pair : ShippedPairs(scenes_)) {
      Names whole = WithNeeds(pair);
      if (std::find(cases.begin(), cases.end(), whole) == cases.end()) {
        cases.push_back(std::move(whole));
      }
    }
    cases.push_back(all);

    run.Say(DescribeMachine());
    const int ticks = run.quick() ? 100 : 1000;
    std::vector<std::string> files;
    for (const Names& names : cases) {
      files.push_back(folder + "/" + std::to_string(files.size()) + ".toml");
      std::ofstream(files.back()) << SceneWith(names);
    }
    run.Progress("instructions", 0);
    const InstructionCounts counts =
        CountInstructions(files, run.quick() ? kCountedQuick : kCounted, folder);
    Table table{"A tick that feeds 0.02 to 0.1 mm, n = 250, in the T-Y phantom; thread-CPU time",
                {"effects", "median ms", "p99 ms", "of none", "instructions, 1000", "heap kB",
                 "residual", "unconverged"},
                {}};
    // One row a case; the effects alone suffice to see.
    Plot plot{"A tick by effects",
              {"median of a tick, us", true},
              {"", false},
              {Series{"", Mark::kPoints, {}, {}}}};
    plot.height = 560;
    Price none;
    for (std::size_t k = 0; k < cases.size(); ++k) {
      const bool is_all = k + 1 == cases.size();
      const std::string case_name = k == 0 ? "none" : is_all ? "all" : Joined(cases[k]);
      run.Progress(case_name, static_cast<double>(k) / static_cast<double>(cases.size()));
      // The first run builds what the library builds once.
      if (k == 0) Measure(files[k], 50);
      const Price price = Measure(files[k], ticks);
      if (k == 0) none = price;
      run.Record(case_name, "tick_ms_p50", price.tick_ms_p50, "ms");
      run.Record(case_name, "tick_ms_p99", price.tick_ms_p99, "ms");
      if (!counts.per_tick.empty()) {
        run.Record(case_name, "instructions", counts.per_tick[k], "");
      }
      run.Record(case_name, "heap_bytes", price.heap_bytes - none.heap_bytes, "B");
      run.Record(case_name, "residual", price.residual, "");
      run.Record(case_name, "unconverged", price.unconverged, "");
      table.rows.push_back(
          {case_name, Number(price.tick_ms_p50), Number(price.tick_ms_p99),
           Number(price.tick_ms_p50 / none.tick_ms_p50),
           counts.per_tick.empty() ? "-" : std::to_string(std::lround(counts.per_tick[k] / 1000)),
           Number((price.heap_bytes - none.heap_bytes) / 1024), Number(price.residual),
           std::to_string(price.unconverged)});
      if (k <= effects::AllEffects().size() || is_all) {
        const double row = -static_cast<double>(plot.callouts.size());
        plot.series[0].x.push_back(1e3 * price.tick_ms_p50);
        plot.series[0].y.push_back(row);
        plot.callouts.push_back({1e3 * price.tick_ms_p50, row, case_name});
      }
    }
    std::filesystem::remove_all(folder);
    run.Section("The price list");
    run.Show(table);
    run.Say(
        "Heap: what scene and session hold more than without any effect. An effect that another "
        "needs is in its row too. What a scene does not name is not made: no memory, no "
        "instruction (tests/effects_cost).");
    run.Say(counts.problem.empty()
                ? "Instructions: the mean of a tick, counted by callgrind; the same on every run."
                : "Instructions are not counted: " + counts.problem + ".");
    run.Draw(plot, "From above: no effect, each alone (with what it needs), all of them.");
    return true;
  }

 private:
  std::string scenes_ = "host/scenes";
};

}  // namespace

std::unique_ptr<Study> MakeEffectsStudy() { return std::make_unique<EffectsStudy>(); }

}  // namespace torquer::study
