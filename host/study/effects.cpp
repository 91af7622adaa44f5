#include "host/study/effects.h"

#include <malloc.h>

#include <algorithm>
#include <cmath>
#include <cstdlib>
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
#include "host/study/picture_prices.h"
#include "host/support/error.h"
#include "host/support/machine.h"

namespace torquer::study {
namespace {

using Names = std::vector<std::string>;

// Scene of all cases: a wire of 250 segments in the phantom.
constexpr char kScene[] = R"(name = "effects"
[vessel]
kind = "ty_phantom"
wall_stiffness_N_mm2 = 0.01
[entry]
centerline = "main"
at_mm = 1
[[instrument]]
max_length_mm = 270
radius_mm = 0.178
rigidity_N_mm2 = 6.35e-3
tip_mm = 10
tip_angle_deg = 30
linear_density_g_m = 0.7
)";
// Outer instruments of cases with more than one instrument: sliding in each other costs time.
constexpr const char* kAround[] = {R"([[instrument]]
name = "microcatheter"
max_length_mm = 250
inserted_at_start_mm = 150
inner_radius_mm = 0.3
radius_mm = 0.5
rigidity_N_mm2 = 0.02
)",
                                   R"([[instrument]]
name = "guiding_catheter"
max_length_mm = 100
inserted_at_start_mm = 80
inner_radius_mm = 0.6
radius_mm = 0.9
rigidity_N_mm2 = 0.05
)"};
// A second wire like the first, beside it.
constexpr char kBuddy[] = R"([[instrument]]
name = "buddy_wire"
max_length_mm = 270
inserted_at_start_mm = 200
radius_mm = 0.178
rigidity_N_mm2 = 6.35e-3
tip_mm = 10
tip_angle_deg = 30
[instrument.entry]
centerline = "main"
at_mm = 1
offset_mm = [0.4, 0]
)";
// Number of feeds with counted instructions: each takes some 5 ms.
constexpr int kCounted = 60;
constexpr int kCountedQuick = 6;

// Measured scene: its effects and number of instruments.
struct Case {
  Names effects;
  int instruments = 1;
  bool has_buddy = false;  // a second wire lies beside the first
  bool is_pair = false;    // pair of effects from a shipped scene
  bool operator==(const Case& other) const {
    return effects == other.effects && instruments == other.instruments &&
           has_buddy == other.has_buddy;
  }
};

// TOML tables that switch on each effect. The friction coefficient is that of the paper's vessel,
// the T-Y phantom.
const std::map<std::string, std::string>& Tables() {
  static const std::map<std::string, std::string> tables = {
      {"torsion", "[effects.torsion]\n"},
      {"friction", "[effects.friction]\ncoefficient = 0.1\n"},
      {"clearance", "[effects.clearance]\n"},
      {"self_contact", "[effects.self_contact]\n"},
      {"friction_between", "[effects.friction_between]\ncoefficient = 0.1\n"},
      {"compliance", R"([effects.compliance]
[[effects.compliance.region]]
centerline = "main"
from_mm = 90
to_mm = 130
radius_mm = 6
factor = 20
)"},
      {"gravity", "[effects.gravity]\n"},
      {"inertia", "[effects.inertia]\n"},
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
      {"internal_forces", "[effects.internal_forces]\n"},
      {"outlets", "[effects.outlets]\n"},
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
      {"lateral_plane", "[effects.lateral_plane]\n"},
      {"patient_monitor", "[effects.patient_monitor]\nat = \"entry\"\n"},
      {"segment_error", "[effects.segment_error]\n"},
  };
  return tables;
}

std::string SceneWith(const Case& one) {
  std::string text = kScene;
  for (int k = 1; k < one.instruments; ++k) text += kAround[k - 1];
  if (one.has_buddy) text += kBuddy;
  for (const std::string& name : one.effects) text += Tables().at(name);
  return text;
}

// Adds the effects that the named ones depend on; dependencies come first.
Names WithNeeds(const Names& names) {
  std::set<std::string> wanted(names.begin(), names.end());
  if (wanted.count("patient_monitor") != 0) wanted.insert("flow");  // or a heartbeat
  for (bool grown = true; grown;) {
    grown = false;
    for (const effects::EffectKind& kind : effects::AllEffects()) {
      if (wanted.count(kind.name) != 0 && !kind.needs.empty()) {
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

std::string NameOf(const Case& one) {
  std::string text;
  if (one.instruments > 1) text = std::to_string(one.instruments) + " instruments";
  if (one.has_buddy) text = "buddy wire";
  for (const std::string& name : one.effects) text += (text.empty() ? "" : "+") + name;
  return text.empty() ? "none" : text;
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

Price Measure(const std::string& scene_file, int ticks, bool quick) {
  const double before = HeapBytes();
  scene::Scene scene(scene_file);
  EffectDrive drive(scene, quick ? kDrivenQuickMm : kDrivenMm);
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

// All pairs of effects that shipped scenes name.
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

// True if the effects act only between instruments.
bool NeedsTwo(const Names& names) {
  return std::any_of(names.begin(), names.end(), [](const std::string& name) {
    return name == "clearance" || name == "friction_between";
  });
}

// Cases without effect: one instrument, more of them without and with torsion, a wire beside the
// first. Cases with effects: each one, the pairs of shipped scenes, all.
std::vector<Case> Cases(const std::string& scenes) {
  std::vector<Case> cases = {{}};
  for (std::size_t k = 0; k < std::size(kAround); ++k) {
    cases.push_back({{}, static_cast<int>(k) + 2});
    cases.push_back({{"torsion"}, static_cast<int>(k) + 2});
  }
  cases.push_back({.effects = {}, .has_buddy = true});
  cases.push_back({.effects = {"torsion", "friction_between"}, .has_buddy = true});
  Case all{{}, 3};
  for (const effects::EffectKind& kind : effects::AllEffects()) {
    if (kind.name == "friction_between") {
      cases.push_back({{"torsion", kind.name}, 2});
    } else if (kind.name == "clearance") {
      cases.push_back({{kind.name}, 2});
      cases.push_back({{"torsion", kind.name}, 2});
      cases.push_back({{"torsion", kind.name, "friction_between"}, 2});
    } else {
      cases.push_back({WithNeeds({kind.name})});
    }
    all.effects.push_back(kind.name);
  }
  for (const Names& pair : ShippedPairs(scenes)) {
    Case whole{WithNeeds(pair), NeedsTwo(pair) ? 2 : 1};
    if (std::find(cases.begin(), cases.end(), whole) == cases.end()) {
      whole.is_pair = true;
      cases.push_back(std::move(whole));
    }
  }
  cases.push_back(std::move(all));
  return cases;
}

std::string CaseName(const std::vector<Case>& cases, std::size_t k) {
  return k + 1 == cases.size() ? "all" : NameOf(cases[k]);
}

std::vector<std::string> WriteScenes(const std::vector<Case>& cases, const std::string& folder) {
  std::vector<std::string> files;
  for (const Case& one : cases) {
    files.push_back(folder + "/" + std::to_string(files.size()) + ".toml");
    std::ofstream(files.back()) << SceneWith(one);
  }
  return files;
}

std::vector<Price> MeasureAll(StudyRun& run, const std::vector<Case>& cases,
                              const std::vector<std::string>& files) {
  // Warm-up run: it builds data that the library builds only once.
  Measure(files[0], 50, run.quick());
  std::vector<Price> prices;
  for (std::size_t k = 0; k < files.size(); ++k) {
    run.Progress(CaseName(cases, k), static_cast<double>(k) / static_cast<double>(files.size()));
    prices.push_back(Measure(files[k], run.quick() ? 100 : 1000, run.quick()));
  }
  return prices;
}

void RecordPrice(StudyRun& run, const std::string& name, const Price& price, const Price& none,
                 const InstructionCounts& counts, std::size_t k) {
  run.Record(name, "tick_ms_p50", price.tick_ms_p50, "ms");
  run.Record(name, "tick_ms_p99", price.tick_ms_p99, "ms");
  if (!counts.per_tick.empty()) run.Record(name, "instructions", counts.per_tick[k], "");
  run.Record(name, "heap_bytes", price.heap_bytes - none.heap_bytes, "B");
  run.Record(name, "residual", price.residual, "");
  run.Record(name, "unconverged", price.unconverged, "");
}

Table PriceTable(const std::vector<Case>& cases, const std::vector<Price>& prices,
                 const InstructionCounts& counts) {
  Table table{"A tick that feeds 0.02 to 0.1 mm, n = 250, in the T-Y phantom; thread-CPU time",
              {"effects", "median ms", "p99 ms", "relative to none", "instructions, 1000",
               "heap kB", "residual", "unconverged"},
              {}};
  const Price& none = prices[0];
  for (std::size_t k = 0; k < cases.size(); ++k) {
    const Price& price = prices[k];
    table.rows.push_back(
        {CaseName(cases, k), Number(price.tick_ms_p50), Number(price.tick_ms_p99),
         Number(price.tick_ms_p50 / none.tick_ms_p50),
         counts.per_tick.empty() ? "-" : std::to_string(std::lround(counts.per_tick[k] / 1000)),
         Number((price.heap_bytes - none.heap_bytes) / 1024), Number(price.residual),
         std::to_string(price.unconverged)});
  }
  return table;
}

// Plot with one row per case, labeled by its effects.
Plot PricePlot(const std::vector<Case>& cases, const std::vector<Price>& prices) {
  Plot plot{"Computing time of a tick, by effects",
            {.label = "median time of a tick, us", .logarithmic = true},
            {.label = "", .is_list = true},
            {Series{"", Mark::kPoints, {}, {}}}};
  plot.width = 900;
  plot.height = 560;
  for (std::size_t k = 0; k < cases.size(); ++k) {
    if (cases[k].is_pair) continue;
    const double row = -static_cast<double>(plot.callouts.size());
    plot.series[0].x.push_back(1e3 * prices[k].tick_ms_p50);
    plot.series[0].y.push_back(row);
    plot.callouts.push_back({1e3 * prices[k].tick_ms_p50, row, CaseName(cases, k)});
  }
  return plot;
}

class EffectsStudy final : public Study {
 public:
  std::string name() const override { return "effects"; }
  std::string title() const override { return "Computing time of each effect"; }
  std::string summary() const override {
    return "time of a tick without effects, with each effect, with pairs of effects and with all";
  }
  void AddOptions(Options& options) override {
    options.Text(
        "--scenes", "FOLDER", scenes_,
        "folder with the scenes for the pairs of effects; without it the scenes that Torquer ships",
        ValueKind::kFolder);
  }

  bool Run(StudyRun& run) override {
    scenes_ = SceneFolder(scenes_);
    if (!std::filesystem::is_directory(scenes_)) {
      throw UserError("--scenes " + scenes_ + ": there is no such folder; give that of the scenes");
    }
    const std::vector<Case> cases = Cases(scenes_);
    run.Say(DescribeMachine());
    std::string folder = std::filesystem::temp_directory_path() / "torquer-effects-XXXXXX";
    if (mkdtemp(folder.data()) == nullptr) {
      throw UserError(folder + ": the folder cannot be created; free space on its disk");
    }
    const std::vector<std::string> files = WriteScenes(cases, folder);
    run.Progress("instructions", 0);
    const InstructionCounts counts =
        CountInstructions(files, run.quick() ? kCountedQuick : kCounted, run.quick(), folder);
    const std::vector<Price> prices = MeasureAll(run, cases, files);
    std::filesystem::remove_all(folder);
    for (std::size_t k = 0; k < cases.size(); ++k) {
      RecordPrice(run, CaseName(cases, k), prices[k], prices[0], counts, k);
    }
    run.Section("The price list");
    run.Show(PriceTable(cases, prices, counts));
    run.Say(
        "Heap: additional memory of scene and simulation, compared with no effect. The row of an "
        "effect includes the effects that it needs. An effect that a scene does not name takes no "
        "memory and no instruction (tests/effects/cost).");
    run.Say(counts.problem.empty()
                ? "Instructions: mean per tick, counted by callgrind; equal on every run."
                : "Instructions are not counted: " + counts.problem + ".");
    run.Draw(PricePlot(cases, prices),
             "Rows from top to bottom: no effect, two and three instruments, each effect alone "
             "(with the effects that it needs), all effects.");
    PricePictures(run);
    return true;
  }

 private:
  std::string scenes_;
};

}  // namespace

std::unique_ptr<Study> MakeEffectsStudy() { return std::make_unique<EffectsStudy>(); }

}  // namespace torquer::study
