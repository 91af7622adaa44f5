#include "host/study/accuracy_report.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <set>

namespace torquer::study {
namespace {

// Groups in the order of the legend.
constexpr const char* kGroups[] = {"newton, 2.5 mm", "newton, 1 mm",        "newton, 0.4 mm",
                                   "newton, 0.2 mm", "newton, time budget", "paper: Tip Relaxation",
                                   "paper: PR",      "paper: PR + GR"};

std::string GroupOf(const AccuracyCase& c) {
  switch (c.method) {
    case AccuracyMethod::kNewtonBudget:
      return "newton, time budget";
    case AccuracyMethod::kPaper:
      return c.cycles == PaperCycles::kNone       ? "paper: Tip Relaxation"
             : c.cycles == PaperCycles::kPhysical ? "paper: PR"
                                                  : "paper: PR + GR";
    default:
      return "newton, " + Number(c.segment_mm) + " mm";
  }
}

Plot DrawFront(const std::string& title, const std::vector<FrontPoint>& points) {
  Plot plot{title,
            {"computing time for 1 mm of motion, ms of one thread", true},
            {"mean distance from the reference, mm", true},
            {}};
  plot.height = 520;
  Series front{"Pareto front", Mark::kDashed, {}, {}, {}, 7};
  for (const FrontPoint& point : ParetoFront(points)) {
    front.x.push_back(point.ms_per_mm);
    front.y.push_back(point.error_mm);
  }
  plot.series.push_back(front);
  for (const std::string group : kGroups) {
    Series series{group, Mark::kPoints, {}, {}};
    for (const FrontPoint& point : points) {
      if (point.group != group) continue;
      series.x.push_back(point.ms_per_mm);
      series.y.push_back(point.error_mm);
      series.notes.push_back(point.name);
      if (point.name == "default") {
        plot.callouts.push_back({point.ms_per_mm, point.error_mm, "default"});
      }
    }
    series.color = static_cast<int>(plot.series.size()) - 1;
    if (!series.x.empty()) plot.series.push_back(std::move(series));
  }
  return plot;
}

std::vector<std::string> Row(const std::string& name, const AccuracyOutcome& o) {
  return {name,
          Number(o.Quantile(0.5)),
          Number(o.Quantile(0.99)),
          Number(o.MsPerMm()),
          Number(1e3 * o.error_mean_mm),
          Number(1e3 * o.error_max_mm),
          Number(1e3 * o.solver_error_mean_mm, 2),
          Number(o.residual_per_length, 2),
          Number(o.energy_gap, 2),
          Number(1e3 * o.penetration_mm),
          std::to_string(o.basin_changes) + "/" + std::to_string(o.places)};
}
std::vector<std::string> Header() {
  return {"setting",         "p50 ms",         "p99 ms",     "ms/mm",    "error um",   "largest um",
          "solver error um", "residual 1/mm2", "energy gap", "depth um", "other basin"};
}

// Points measured in every scene, as geometric means over the scenes.
std::vector<FrontPoint> OverScenes(const std::vector<FrontPoint>& any,
                                   const std::map<std::string, MeasuredCases>& measured) {
  std::vector<FrontPoint> points;
  for (FrontPoint point : any) {
    double log_ms = 0;
    double log_mm = 0;
    bool everywhere = true;
    for (const auto& [scene, cases] : measured) {
      const auto found = cases.find(point.name);
      if (found == cases.end() || !(found->second.outcome.error_mean_mm > 0)) {
        everywhere = false;
        break;
      }
      log_ms += std::log(found->second.outcome.MsPerMm());
      log_mm += std::log(found->second.outcome.error_mean_mm);
    }
    if (!everywhere) continue;
    const auto scenes = static_cast<double>(measured.size());
    point.ms_per_mm = std::exp(log_ms / scenes);
    point.error_mm = std::exp(log_mm / scenes);
    points.push_back(point);
  }
  return points;
}

std::vector<FrontPoint> PointsOf(const MeasuredCases& cases) {
  std::vector<FrontPoint> points;
  for (const auto& [name, measured] : cases) {
    const bool front = name.starts_with("newton/") || name.starts_with("paper/");
    if (!front && name != "default") continue;
    points.push_back({name, GroupOf(measured.setting), measured.outcome.MsPerMm(),
                      measured.outcome.error_mean_mm});
  }
  return points;
}

const AccuracyOutcome* Find(const MeasuredCases& cases, const std::string& name) {
  const auto found = cases.find(name);
  return found == cases.end() ? nullptr : &found->second.outcome;
}

// Plot with one line per scene: a figure of the cases `names` over x.
Plot LinesOfScenes(const std::string& title, const Axis& x_axis, const Axis& y_axis,
                   const AccuracyResults& results, const std::vector<double>& x,
                   const std::vector<std::string>& names,
                   double (*figure)(const AccuracyOutcome&)) {
  Plot plot{title, x_axis, y_axis, {}};
  for (const auto& [scene, cases] : results.measured) {
    Series series{scene, Mark::kLineAndPoints, {}, {}};
    for (std::size_t k = 0; k < x.size(); ++k) {
      const AccuracyOutcome* outcome = Find(cases, names[k]);
      if (outcome == nullptr) continue;
      series.x.push_back(x[k]);
      series.y.push_back(figure(*outcome));
      series.notes.push_back(names[k]);
    }
    plot.series.push_back(std::move(series));
  }
  return plot;
}

double ErrorOf(const AccuracyOutcome& o) { return o.error_mean_mm; }
double SolverErrorOf(const AccuracyOutcome& o) { return o.solver_error_mean_mm; }
double TimeOf(const AccuracyOutcome& o) { return o.MsPerMm(); }

// Ladder: cases that differ in one parameter x, as x and case name, in ascending order of x.
struct Ladder {
  std::vector<double> x;
  std::vector<std::string> names;
};

template <class Wanted, class Value>
Ladder LadderOf(const AccuracyResults& results, Wanted wanted, Value value) {
  std::map<double, std::string> rungs;
  for (const auto& [scene, cases] : results.measured) {
    for (const auto& [name, measured] : cases) {
      if (name.starts_with("newton/") && wanted(measured.setting)) {
        rungs[value(measured.setting)] = name;
      }
    }
  }
  Ladder ladder;
  for (const auto& [x, name] : rungs) {
    ladder.x.push_back(x);
    ladder.names.push_back(name);
  }
  return ladder;
}

Ladder Tolerances(const AccuracyResults& results) {
  return LadderOf(
      results,
      [](const AccuracyCase& c) {
        return c.method == AccuracyMethod::kNewtonTolerance && c.segment_mm == 1;
      },
      [](const AccuracyCase& c) { return c.tolerance; });
}

Ladder Segments(const AccuracyResults& results) {
  return LadderOf(
      results,
      [](const AccuracyCase& c) {
        return c.method == AccuracyMethod::kNewtonTolerance && c.tolerance == 1e-6;
      },
      [](const AccuracyCase& c) { return c.segment_mm; });
}

Ladder Budgets(const AccuracyResults& results) {
  return LadderOf(
      results,
      [](const AccuracyCase& c) {
        return c.method == AccuracyMethod::kNewtonBudget && c.segment_mm == 1;
      },
      [](const AccuracyCase& c) { return c.budget_us; });
}

// Compares the ends of a ladder in each scene: decrease of the error and increase of the time.
void SayDigit(StudyRun& run, const AccuracyResults& results) {
  const Ladder tolerances = Tolerances(results);
  const Ladder segments = Segments(results);
  Table table{"Cost of one more digit",
              {"scene", "solver: time for a tenth of its error", "segments: order of the error",
               "time for a tenth of it"},
              {}};
  for (const auto& [scene, cases] : results.measured) {
    const auto digits = [&, &cases = cases](const std::string& from, const std::string& to,
                                            double (*error)(const AccuracyOutcome&),
                                            double& factor) {
      const AccuracyOutcome* a = Find(cases, from);
      const AccuracyOutcome* b = Find(cases, to);
      if (a == nullptr || b == nullptr) return std::numeric_limits<double>::quiet_NaN();
      const double gained = std::log10(error(*a) / error(*b));
      factor = std::pow(b->MsPerMm() / a->MsPerMm(), 1 / gained);
      return gained;
    };
    double solver_factor = 1;
    // Tolerances down to 1e-7 only: lower ones are close to the companion's own tolerance.
    std::string tight = tolerances.names.front();
    for (std::size_t k = 0; k < tolerances.x.size(); ++k) {
      if (tolerances.x[k] > 5e-8) {
        tight = tolerances.names[k];
        break;
      }
    }
    digits(tolerances.names.back(), tight, SolverErrorOf, solver_factor);
    double segment_factor = 1;
    const double gained =
        digits(segments.names.back(), segments.names.front(), ErrorOf, segment_factor);
    const double order = gained / std::log10(segments.x.back() / segments.x.front());
    run.Record(scene + "/digit", "solver_time_factor", solver_factor, "");
    run.Record(scene + "/digit", "segment_order", order, "");
    run.Record(scene + "/digit", "segment_time_factor", segment_factor, "");
    table.rows.push_back(
        {scene, "x " + Number(solver_factor), Number(order, 2), "x " + Number(segment_factor)});
  }
  run.Show(table);
}

void ReportFront(StudyRun& run, const AccuracyResults& results) {
  run.Section("Error against time");
  const std::vector<FrontPoint> all =
      OverScenes(PointsOf(results.measured.begin()->second), results.measured);
  run.Draw(DrawFront("Error against time, over all scenes", all),
           "Each point is a setting; its time and error are geometric means over the scenes. A "
           "setting is shown if it stayed in its basin in every scene. Error: mean distance of the "
           "wire from a reference wire, after 10 mm of feeding and turning. The reference has ten "
           "times finer segments and is relaxed to 1e-9; both start from its state. Newton's "
           "method feeds in actions of 0.1 mm and has friction. The paper's method feeds in "
           "segments and has no friction. Each method is compared with its own reference physics. "
           "Lengths in the legend: segments. With a time budget an action stops after a set time, "
           "otherwise at a tolerance. PR and GR: the paper's Physical and Geometrical Relaxation.");
  Table front{"The Pareto front", {"setting", "ms/mm", "mean error um"}, {}};
  for (const FrontPoint& point : ParetoFront(all)) {
    front.rows.push_back({point.name, Number(point.ms_per_mm), Number(1e3 * point.error_mm)});
    run.Record("front/" + point.name, "ms_per_mm", point.ms_per_mm, "ms/mm");
    run.Record("front/" + point.name, "error_mean", point.error_mm, "mm");
  }
  run.ShowFirst(front);
  SayDigit(run, results);
}

// Reports one setting at a time; all others have their defaults.
void ReportLadders(StudyRun& run, const AccuracyResults& results) {
  run.Section("Tolerance");
  const Ladder tolerances = Tolerances(results);
  const Axis tolerance_axis{"tolerance of the residual, 1/mm", true};
  run.Draw(LinesOfScenes("Solver's error over tolerance, segments of 1 mm", tolerance_axis,
                         {"mean distance from the same setting at 1e-9, mm", true}, results,
                         tolerances.x, tolerances.names, SolverErrorOf),
           "Error of the solver, without the error of the segments.");
  run.Draw(LinesOfScenes("Time over tolerance, segments of 1 mm", tolerance_axis,
                         {"computing time for 1 mm of motion, ms", true}, results, tolerances.x,
                         tolerances.names, TimeOf),
           "Near the solution each Newton step gains several digits.");
  run.Section("Segment length");
  const Ladder segments = Segments(results);
  run.Draw(LinesOfScenes("Error over segment length, tolerance 1e-6", {"segment length, mm", true},
                         {"mean error, mm", true}, results, segments.x, segments.names, ErrorOf),
           "Finer segments increase the accuracy; the time grows in proportion to their number.");
  run.Section("Budget");
  const Ladder budgets = Budgets(results);
  run.Draw(LinesOfScenes("Error over the budget of an action, segments of 1 mm",
                         {"budget of an action, us", true}, {"mean error, mm", true}, results,
                         budgets.x, budgets.names, ErrorOf),
           "A tick that spends its budget leaves residual and motion to the next tick.");
}

// Plot with one point for each scene and setting.
Plot PointsOfScenes(const std::string& title, const AccuracyResults& results,
                    const std::vector<std::string>& names) {
  Plot plot{title, {"computing time for 1 mm of motion, ms", true}, {"mean error, mm", true}, {}};
  std::set<std::string> named;
  for (const std::string& name : names) {
    Series series{name, Mark::kPoints, {}, {}};
    for (const auto& [scene, cases] : results.measured) {
      const AccuracyOutcome* outcome = Find(cases, name);
      if (outcome == nullptr) continue;
      series.x.push_back(outcome->MsPerMm());
      series.y.push_back(outcome->error_mean_mm);
      series.notes.push_back(scene);
      if (std::isfinite(outcome->error_mean_mm) && named.insert(scene).second) {
        plot.callouts.push_back({outcome->MsPerMm(), outcome->error_mean_mm, scene});
      }
    }
    plot.series.push_back(std::move(series));
  }
  return plot;
}

void ReportAxis(StudyRun& run, const AccuracyResults& results, const AccuracyAxis& axis) {
  run.Section(axis.title);
  std::vector<std::string> names;
  for (const AccuracyCase& c : axis.cases) names.push_back(c.name);
  if (!axis.x.empty()) {
    run.Draw(LinesOfScenes(axis.title, {axis.x_label}, {"mean error, mm", true}, results, axis.x,
                           names, ErrorOf),
             "All other settings have their defaults.");
  } else {
    run.Draw(PointsOfScenes(axis.title, results, names),
             "Each scene has one point; the first setting that stayed in its basin is labeled with "
             "the scene.");
  }
  for (const auto& [scene, cases] : results.measured) {
    Table table{axis.title + ", " + scene, Header(), {}};
    for (const std::string& name : names) {
      const AccuracyOutcome* outcome = Find(cases, name);
      if (outcome != nullptr) table.rows.push_back(Row(name, *outcome));
    }
    run.Show(table);
  }
}

void ReportScenes(StudyRun& run, const AccuracyResults& results) {
  for (const auto& [scene, cases] : results.measured) {
    run.Section(scene);
    run.Draw(DrawFront("Error against time, " + scene, PointsOf(cases)),
             "All settings of segments and method in this scene.");
    Table table{"Segments and methods, " + scene, Header(), {}};
    for (const FrontPoint& point : PointsOf(cases)) {
      table.rows.push_back(Row(point.name, *Find(cases, point.name)));
    }
    run.Show(table);
  }
}

void SayLeftOut(StudyRun& run, const AccuracyResults& results) {
  std::string left_out;
  for (const auto& [name, scenes] : results.left_out) {
    left_out += (left_out.empty() ? "" : "; ") + name + " (";
    for (const std::string& scene : scenes) left_out += (scene == scenes[0] ? "" : ", ") + scene;
    left_out += ")";
  }
  if (!left_out.empty()) run.Say("Omitted because of their computing time: " + left_out + ".");
}

}  // namespace

std::vector<FrontPoint> ParetoFront(std::vector<FrontPoint> points) {
  std::sort(points.begin(), points.end(),
            [](const FrontPoint& a, const FrontPoint& b) { return a.ms_per_mm < b.ms_per_mm; });
  std::vector<FrontPoint> front;
  for (const FrontPoint& point : points) {
    if (front.empty() || point.error_mm < front.back().error_mm) front.push_back(point);
  }
  return front;
}

void ReportAccuracy(StudyRun& run, const AccuracyResults& results) {
  ReportFront(run, results);
  ReportLadders(run, results);
  for (const AccuracyAxis& axis : results.axes) ReportAxis(run, results, axis);
  ReportScenes(run, results);
  SayLeftOut(run, results);
}

}  // namespace torquer::study
