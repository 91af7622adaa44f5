#include "host/study/trace.h"

#include <fmt/format.h>

#include <algorithm>
#include <filesystem>
#include <string>
#include <vector>

#include "host/api/row_run.h"
#include "host/api/script_columns.h"
#include "host/simulator/exchangeable_simulation.h"
#include "host/study/quantile.h"

namespace torquer::study {
namespace {

// Tick with its attempts, as a range of indices into the attempts of the whole script.
struct TracedTick {
  double time_s = 0;
  std::size_t first = 0;
  std::size_t count = 0;
  TickReport report;
};

struct Trace {
  std::vector<AttemptRecord> attempts;
  std::vector<TracedTick> ticks;
};

Trace Run(StudyRun& run, scene::Scene& scene, const std::string& script) {
  const auto rows = ReadScript(script, scene.path(), InstrumentsOf(scene));
  simulator::ExchangeableSimulation simulation(scene);
  RowRun motion(simulation.now());
  Trace trace;
  simulation.now().RecordAttempts(&trace.attempts);
  const double first_s = rows.empty() ? 0 : rows.front().time_s;
  const auto take_tick = [&](const auto&) {
    TracedTick tick;
    tick.time_s = first_s + simulation.now().time_s();
    if (!trace.ticks.empty()) tick.first = trace.ticks.back().first + trace.ticks.back().count;
    tick.count = trace.attempts.size() - tick.first;
    tick.report = simulation.now().report();
    trace.ticks.push_back(tick);
    return true;
  };
  for (std::size_t k = 0; k < rows.size(); ++k) {
    for (const auto& [instrument, device] : rows[k].exchanges) {
      simulation.Exchange(static_cast<int>(instrument), device);
      simulation.now().RecordAttempts(&trace.attempts);
      motion.ContinueIn(simulation.now());
    }
    run.Progress(fmt::format("{:.2f} s", rows[k].time_s),
                 static_cast<double>(k) / static_cast<double>(rows.size()));
    motion.GoTo(rows[k].command, take_tick);
  }
  return trace;
}

void WriteAttempts(const Trace& trace, const std::string& path) {
  std::string text =
      "tick,time_s,attempt,accepted,residual,energy_mJ,weight,step_scale,expected_mJ,gained_mJ,"
      "active_set_rounds,lookups\n";
  for (std::size_t t = 0; t < trace.ticks.size(); ++t) {
    const TracedTick& tick = trace.ticks[t];
    for (std::size_t k = 0; k < tick.count; ++k) {
      const AttemptRecord& one = trace.attempts[tick.first + k];
      text += fmt::format("{},{},{},{:d},{},{},{},{},{},{},{},{}\n", t + 1, tick.time_s, k + 1,
                          one.accepted, one.residual, one.energy_mJ, one.weight, one.step_scale,
                          one.expected_mJ, one.gained_mJ, one.active_set_rounds, one.lookups);
    }
  }
  WriteWhole(path, text);
}

template <class Items, class Value>
std::vector<double> Each(const Items& items, Value value) {
  std::vector<double> values;
  for (const auto& item : items) values.push_back(static_cast<double>(value(item)));
  return values;
}

// Adds the median, 99th percentile and maximum of a figure.
void Summarize(StudyRun& run, Table& table, const std::string& name, const std::string& metric,
               const std::vector<double>& values) {
  const double p50 = Quantile(values, 0.5);
  const double p99 = Quantile(values, 0.99);
  const double most = Quantile(values, 1);
  table.rows.push_back({name, Number(p50), Number(p99), Number(most)});
  run.Record("script", metric + "_p50", p50, "");
  run.Record("script", metric + "_p99", p99, "");
  run.Record("script", metric + "_max", most, "");
}

void ShowSummary(StudyRun& run, const Trace& trace) {
  Table table{"Work of a tick and of an attempt", {"", "median", "p99", "most"}, {}};
  Summarize(run, table, "attempts a tick", "attempts_a_tick",
            Each(trace.ticks, [](const TracedTick& tick) { return tick.count; }));
  Summarize(run, table, "rounds of the active set an attempt", "rounds_an_attempt",
            Each(trace.attempts, [](const AttemptRecord& one) { return one.active_set_rounds; }));
  Summarize(run, table, "look-ups of the vessel an attempt", "lookups_an_attempt",
            Each(trace.attempts, [](const AttemptRecord& one) { return one.lookups; }));
  Summarize(run, table, "residual at the end of a tick", "residual",
            Each(trace.ticks, [](const TracedTick& tick) { return tick.report.residual; }));
  run.ShowFirst(table);

  const auto count = [&](auto holds) {
    return static_cast<double>(std::count_if(trace.ticks.begin(), trace.ticks.end(), holds));
  };
  const auto refused =
      static_cast<double>(std::count_if(trace.attempts.begin(), trace.attempts.end(),
                                        [](const AttemptRecord& one) { return !one.accepted; }));
  const double stalled = count([](const TracedTick& tick) { return tick.report.stalled; });
  const double spent = count([](const TracedTick& tick) { return tick.report.budget_spent; });
  const double snapped = count([](const TracedTick& tick) { return tick.report.snapped; });
  run.Record("script", "ticks", static_cast<double>(trace.ticks.size()), "");
  run.Record("script", "attempts", static_cast<double>(trace.attempts.size()), "");
  run.Record("script", "refused", refused, "");
  run.Record("script", "stalled_ticks", stalled, "");
  run.Record("script", "spent_ticks", spent, "");
  run.Record("script", "snapped_ticks", snapped, "");
  run.Say(
      fmt::format("{} ticks, {} attempts at a step, {:g} of them refused; {:g} ticks stalled, "
                  "{:g} ended by their budget, {:g} snapped.",
                  trace.ticks.size(), trace.attempts.size(), refused, stalled, spent, snapped));
}

void ShowHardest(StudyRun& run, const Trace& trace) {
  constexpr std::size_t kShown = 12;
  std::vector<std::size_t> order;
  for (std::size_t t = 0; t < trace.ticks.size(); ++t) order.push_back(t);
  std::stable_sort(order.begin(), order.end(), [&](std::size_t a, std::size_t b) {
    return trace.ticks[a].count > trace.ticks[b].count;
  });
  Table table{"The ticks with the most attempts",
              {"tick", "time, s", "attempts", "refused", "first residual", "last", "largest weight",
               "shortest step", "end"},
              {}};
  for (std::size_t k = 0; k < std::min(kShown, order.size()); ++k) {
    const TracedTick& tick = trace.ticks[order[k]];
    if (tick.count == 0) break;
    int refused = 0;
    double weight = 0;
    double shortest = 1;
    for (std::size_t a = tick.first; a < tick.first + tick.count; ++a) {
      const AttemptRecord& one = trace.attempts[a];
      refused += !one.accepted;
      weight = std::max(weight, one.weight);
      if (one.step_scale > 0) shortest = std::min(shortest, one.step_scale);
    }
    table.rows.push_back({std::to_string(order[k] + 1), Number(tick.time_s, 6),
                          std::to_string(tick.count), std::to_string(refused),
                          Number(trace.attempts[tick.first].residual), Number(tick.report.residual),
                          Number(weight), Number(shortest),
                          tick.report.converged      ? "at rest"
                          : tick.report.budget_spent ? "budget spent"
                                                     : "stalled"});
  }
  run.Show(table);
}

// Plots a figure of every attempt: one series for accepted and one for refused attempts.
template <class Value>
void DrawAttempts(StudyRun& run, const Trace& trace, const std::string& title, const Axis& axis,
                  const std::string& caption, Value value) {
  Series accepted{.label = "accepted", .mark = Mark::kPoints, .x = {}, .y = {}};
  Series refused{.label = "refused", .mark = Mark::kPoints, .x = {}, .y = {}};
  for (const TracedTick& tick : trace.ticks) {
    for (std::size_t k = 0; k < tick.count; ++k) {
      const AttemptRecord& one = trace.attempts[tick.first + k];
      Series& series = one.accepted ? accepted : refused;
      series.x.push_back(tick.time_s);
      series.y.push_back(static_cast<double>(value(one)));
    }
  }
  Plot plot;
  plot.title = title;
  plot.x.label = "time of the script, s";
  plot.y = axis;
  plot.series = {accepted, refused};
  run.Draw(plot, caption);
}

void DrawAll(StudyRun& run, const Trace& trace) {
  Series attempts{.label = "", .mark = Mark::kPoints, .x = {}, .y = {}};
  for (const TracedTick& tick : trace.ticks) {
    attempts.x.push_back(tick.time_s);
    attempts.y.push_back(static_cast<double>(tick.count));
  }
  Plot plot;
  plot.title = "Attempts a tick";
  plot.x.label = "time of the script, s";
  plot.y.label = "attempts";
  plot.series = {attempts};
  run.Draw(plot, "Difficult ticks: contacts change, tips pass an opening, or the wire snaps.");
  DrawAttempts(run, trace, "Residual", {"residual before the attempt", true},
               "Near the solution of Newton's method each attempt squares the residual.",
               [](const AttemptRecord& one) { return one.residual; });
  DrawAttempts(run, trace, "Damping", {"weight", true},
               "In units of the local EI/(1 mm). Attempts without damping are not on this axis.",
               [](const AttemptRecord& one) { return one.weight; });
  DrawAttempts(run, trace, "Length of the step", {"fraction of the model's step"},
               "0: the model had no minimum, or the active set did not converge.",
               [](const AttemptRecord& one) { return one.step_scale; });
  DrawAttempts(run, trace, "Gained and expected energy", {"gained / expected"},
               "1: the energy model was exact. Below 0.1 the attempt is refused.",
               [](const AttemptRecord& one) {
                 return one.expected_mJ > 0 ? one.gained_mJ / one.expected_mJ : 0;
               });
  DrawAttempts(run, trace, "Rounds of the active set", {"solutions of the model"},
               "1: no contact opened or closed in the step.",
               [](const AttemptRecord& one) { return one.active_set_rounds; });
  DrawAttempts(run, trace, "Look-ups of the vessel's field", {"look-ups", true},
               "A point that cannot have reached the wall since its last look-up needs no look-up.",
               [](const AttemptRecord& one) { return one.lookups; });
}

class TraceStudy final : public Study {
 public:
  std::string name() const override { return "trace"; }
  std::string title() const override { return "Steps of the solver"; }
  std::string summary() const override {
    return "every attempt of the solver in a script: residual, damping, step, contacts, look-ups";
  }
  void AddOptions(Options& options) override {
    options.Operand("SCENE", scene_, "scene file, whose method must be newton");
    options.Operand("SCRIPT", script_,
                    "script of the motion, in the format of torquer-simulator --script");
  }

  bool Run(StudyRun& run) override {
    if (scene_.empty() || script_.empty()) {
      throw UsageError("SCENE and SCRIPT are missing; give a scene file and a script for it");
    }
    scene::Scene scene(scene_);
    const Trace trace = study::Run(run, scene, script_);
    if (trace.attempts.empty()) {
      throw UserError(scene_ + " with " + script_ +
                      ": no attempt was recorded; give a scene with method = \"newton\" and a "
                      "script that moves something");
    }
    run.Say(scene_ + ", " + script_);
    ShowSummary(run, trace);
    run.Section("Hard ticks");
    ShowHardest(run, trace);
    run.Section("Every attempt");
    DrawAll(run, trace);
    MakeFolder(run.folder());
    const std::string file = run.folder() + "/trace_attempts.csv";
    WriteAttempts(trace, file);
    run.Say("All values of every attempt: " + file + ".");
    return true;
  }

 private:
  std::string scene_;
  std::string script_;
};

}  // namespace

std::unique_ptr<Study> MakeTraceStudy() { return std::make_unique<TraceStudy>(); }

}  // namespace torquer::study
