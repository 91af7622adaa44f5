#include "host/study/torture.h"

#include <algorithm>
#include <chrono>
#include <map>
#include <optional>
#include <sstream>

#include "host/study/cases/hard_cases.h"
#include "host/study/cases/random_scene.h"
#include "host/study/cases/scene_run.h"
#include "host/support/error.h"
#include "host/support/machine.h"

namespace torquer::study {
namespace {

class Stopwatch {
 public:
  double Seconds() const {
    return std::chrono::duration<double>(std::chrono::steady_clock::now() - start_).count();
  }

 private:
  std::chrono::steady_clock::time_point start_ = std::chrono::steady_clock::now();
};

// Results over all runs of one case with one method.
struct Tally {
  int runs = 0;
  int ticks = 0;
  int converged = 0;
  int snaps = 0;
  int at_rest = 0;  // runs that ended in equilibrium
  double deepest_mm = 0;
  double worst_rise = 0;
  // Scenes at rest: overlap of an instrument with the lumen around it, and smallest distance of
  // instruments beside each other. The unit is the distance at which they touch.
  std::optional<double> overlap_mm;
  std::optional<double> closest;
  int sharp_bends = 0;  // ticks at rest whose contacts are not checked
};

constexpr char kSceneName[] = "a scene at random";

class TortureStudy final : public Study {
 public:
  std::string name() const override { return "torture"; }
  std::string title() const override { return "Random hard cases"; }
  std::string summary() const override {
    return "random hard cases for a given time; fails if an invariant is violated";
  }
  void AddOptions(Options& options) override {
    options.Integer("--seconds", "S", seconds_, 0, 1000000,
                    "duration of the study; without it 60, or 10 with --quick; 0: one case");
    options.Integer("--seed", "N", seed_, 0, 2000000000, "seed of the first case");
    options.Text("--scene", "SCENE", scene_, "random hands in this scene alone");
    options.Flag("--soak", soak_,
                 "run every case completely by every method instead, which takes minutes");
  }

  bool Run(StudyRun& run) override {
    if (soak_ && seconds_) {
      throw UsageError("--soak and --seconds exclude each other; leave out one");
    }
    if (soak_ && !scene_.empty())
      throw UsageError("--soak and --scene exclude each other; leave out one");
    run.Say(DescribeMachine());
    const bool held = soak_ ? Soak(run) : Draw(run);
    Report(run);
    run.Record("all", "cases", cases_, "");
    run.Record("all", "ticks", static_cast<double>(ticks_), "");
    run.Record("all", "violations", held ? 0 : 1, "");
    run.Record("all", "wall_time", watch_.Seconds(), "s");
    if (held) {
      run.Say("Every invariant held: " + std::to_string(cases_) + " cases, " +
              std::to_string(ticks_) + " ticks, first seed " + std::to_string(seed_) + ".");
    }
    return held;
  }

 private:
  // The seed determines the case, the method and the random parameters of the case.
  bool Draw(StudyRun& run) {
    const std::vector<HardCase> cases = HardCases();
    const unsigned seconds = seconds_.value_or(run.quick() ? 10 : 60);
    for (unsigned seed = seed_;; ++seed) {
      const double done = seconds == 0 ? 0 : std::min(1.0, watch_.Seconds() / seconds);
      std::mt19937 random(seed);
      if (!DrawOne(run, seed, random, done, cases)) {
        run.Record("failure", "seed", seed, "");
        return false;
      }
      if (watch_.Seconds() >= seconds) return true;
    }
  }

  // A quarter each: a scene at random, a shipped scene, a wire with "anything at random", a named
  // case.
  bool DrawOne(StudyRun& run, unsigned seed, std::mt19937& random, double done,
               const std::vector<HardCase>& cases) {
    if (!scene_.empty()) return DrawHands(run, scene_, seed, random, done);
    const auto kind = random() % 4;
    if (kind == 0) return DrawScene(run, seed, random, done);
    if (kind == 1) return DrawShipped(run, seed, random, done);
    return DrawCase(run, seed, random, done, kind == 2, cases);
  }

  bool DrawCase(StudyRun& run, unsigned seed, std::mt19937& random, double done, bool anything,
                const std::vector<HardCase>& cases) {
    const HardCase& hard = cases[anything ? cases.size() - 1 : random() % (cases.size() - 1)];
    Way way = kAllWays[random() % std::size(kAllWays)];
    if (!hard.for_paper && way == Way::kPaper) way = Way::kNewton;
    run.Progress("seed " + std::to_string(seed) + ", " + hard.name, done);
    return Take(run, hard, way, RunHardCase(hard, way, seed), Again(seed));
  }

  bool DrawScene(StudyRun& run, unsigned seed, std::mt19937& random, double done) {
    run.Progress("seed " + std::to_string(seed) + ", " + kSceneName, done);
    const std::string text = RandomScene(random);
    scene::Scene scene(scene::ParseScene(text, "random.toml", "."));
    if (Take(run, kSceneName, scene, seed, random)) return true;
    run.Say("The scene:\n" + text);
    return false;
  }

  bool DrawShipped(StudyRun& run, unsigned seed, std::mt19937& random, double done) {
    static constexpr const char* kShipped[] = {"everything", "buddy_wire", "triaxial"};
    return DrawHands(run, kShipped[random() % std::size(kShipped)], seed, random, done);
  }

  // Random hands in a scene, with one more start for each seed.
  bool DrawHands(StudyRun& run, const std::string& name, unsigned seed, std::mt19937& random,
                 double done) {
    run.Progress("seed " + std::to_string(seed) + ", " + name, done);
    std::unique_ptr<scene::Scene>& scene = loaded_[name];
    if (scene == nullptr) scene = std::make_unique<scene::Scene>(name);
    return Take(run, name + " with random hands", *scene->MakeTwin(), seed, random);
  }

  bool Take(StudyRun& run, const std::string& name, scene::Scene& scene, unsigned seed,
            std::mt19937& random) {
    constexpr int kMoves = 30;
    const SceneOutcome outcome = RunScene(scene, random, kMoves);
    Tally& tally = tallies_[name];
    Add(tally, outcome);
    tally.overlap_mm = std::max(tally.overlap_mm.value_or(0), outcome.overlap_mm);
    tally.closest = std::min(tally.closest.value_or(1), outcome.closest);
    tally.sharp_bends += outcome.sharp_bends;
    if (outcome.broken.empty()) return true;
    run.Say("BROKEN: " + name + ", " + Again(seed) + "\n  " + outcome.broken);
    return false;
  }

  std::string Again(unsigned seed) const {
    const std::string number = std::to_string(seed);
    return "seed " + number + "; again: torquer-study torture --seconds 0 --seed " + number +
           (scene_.empty() ? "" : " --scene " + scene_);
  }

  bool Soak(StudyRun& run) {
    const std::vector<HardCase> cases = HardCases(Extent::kSoak);
    constexpr int kDraws = 200;
    for (std::size_t k = 0; k < cases.size(); ++k) {
      const bool at_random = k + 1 == cases.size();
      for (const Way way : kAllWays) {
        if (!cases[k].for_paper && way == Way::kPaper) continue;
        for (unsigned draw = 0; draw < (at_random ? kDraws : 1u); ++draw) {
          const auto progress = [&](int ticks) {
            if (ticks % 64 != 0) return;
            run.Progress(cases[k].name + ", " + NameOf(way) + ", tick " + std::to_string(ticks),
                         static_cast<double>(k) / static_cast<double>(cases.size()));
          };
          const HardOutcome outcome = RunHardCase(cases[k], way, seed_ + draw, progress);
          if (!Take(run, cases[k], way, outcome, "seed " + std::to_string(seed_ + draw))) {
            run.Record("failure", "seed", seed_ + draw, "");
            return false;
          }
        }
      }
    }
    return true;
  }

  bool Take(StudyRun& run, const HardCase& hard, Way way, const HardOutcome& outcome,
            const std::string& how) {
    Add(tallies_[hard.name + ", " + NameOf(way)], outcome);
    const std::string objection = Objection(hard, way, outcome);
    if (objection.empty()) return true;
    run.Say("BROKEN: " + hard.name + ", " + NameOf(way) + ", " + how + "\n  " + objection);
    return false;
  }

  template <class Outcome>
  void Add(Tally& tally, const Outcome& outcome) {
    ++cases_;
    ticks_ += outcome.ticks;
    ++tally.runs;
    tally.ticks += outcome.ticks;
    tally.converged += outcome.converged;
    tally.snaps += outcome.snaps;
    tally.at_rest += outcome.settled;
    tally.deepest_mm = std::max(tally.deepest_mm, outcome.deepest_mm);
    tally.worst_rise = std::max(tally.worst_rise, outcome.worst_rise);
  }

  void Report(StudyRun& run) const {
    Table table{"Results of the cases",
                {"case", "runs", "ticks", "at rest, % of ticks", "at rest at the end", "snaps",
                 "deepest, mm", "energy rise of a step", "overlap in a lumen, mm",
                 "closest beside, of touching", "bends sharper than the lumen, ticks"},
                {}};
    for (const auto& [name, t] : tallies_) {
      table.rows.push_back(
          {name, std::to_string(t.runs), std::to_string(t.ticks),
           Number(100.0 * t.converged / std::max(1, t.ticks)), std::to_string(t.at_rest),
           std::to_string(t.snaps), Number(t.deepest_mm), Number(t.worst_rise, 2),
           t.overlap_mm ? Number(*t.overlap_mm, 2) : "", t.closest ? Number(*t.closest, 2) : "",
           t.overlap_mm ? std::to_string(t.sharp_bends) : ""});
      run.Record(name, "runs", t.runs, "");
      run.Record(name, "ticks", t.ticks, "");
      run.Record(name, "at_rest", t.at_rest, "");
      run.Record(name, "snaps", t.snaps, "");
      run.Record(name, "penetration_max", 1e3 * t.deepest_mm, "um");
      run.Record(name, "energy_rise", t.worst_rise, "");
      if (!t.overlap_mm) continue;
      run.Record(name, "lumen_overlap_max", 1e3 * *t.overlap_mm, "um");
      run.Record(name, "closest_beside", *t.closest, "");
      run.Record(name, "sharp_bends", t.sharp_bends, "");
    }
    run.Show(table);
  }

  std::optional<unsigned> seconds_;
  unsigned seed_ = 1;
  std::string scene_;
  bool soak_ = false;
  int cases_ = 0;
  std::int64_t ticks_ = 0;
  std::map<std::string, Tally> tallies_;
  std::map<std::string, std::unique_ptr<scene::Scene>> loaded_;  // by name, once used
  Stopwatch watch_;
};

}  // namespace

std::unique_ptr<Study> MakeTortureStudy() { return std::make_unique<TortureStudy>(); }

}  // namespace torquer::study
