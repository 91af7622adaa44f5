#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <map>

#include "host/simulator/core/paper/predecessor_relaxation.h"
#include "host/study/cpu_time.h"
#include "host/study/lumen_view.h"
#include "host/study/paper_bench.h"
#include "host/study/paper_parts.h"

namespace torquer::study {
namespace {

constexpr int kCycles = 100;  // number of cycles in Table 1

// Times printed in the paper: Table 1, (33).
struct PaperTimes {
  double physical_s, geometrical_s;
};
constexpr std::array<PaperTimes, 3> kTable1 = {{{0.984, 0.0160}, {9.33, 0.0704}, {103.7, 0.2431}}};

double Median(std::vector<double> values) {
  const auto middle = values.begin() + static_cast<std::ptrdiff_t>(values.size() / 2);
  std::nth_element(values.begin(), middle, values.end());
  return *middle;
}

// Lumen in the plane of the phantom's T, as an area for the plot.
Series Lumen(const vessel::TubeVessel& phantom) {
  constexpr double kStepMm = 0.25;
  Series series{"lumen", Mark::kArea, {}, {}, {}, 7};
  const auto add = [&series](double x, double y) {
    series.x.push_back(x);
    series.y.push_back(y);
  };
  for (const LumenRun& run : SeeLumen(*phantom.field, phantom.bounds_mm, kStepMm)) {
    add(run.from_mm, run.y_mm - kStepMm / 2);
    add(run.to_mm, run.y_mm - kStepMm / 2);
    add(run.to_mm, run.y_mm + kStepMm / 2);
    add(run.from_mm, run.y_mm + kStepMm / 2);
    const double end = std::numeric_limits<double>::quiet_NaN();
    add(end, end);
  }
  return series;
}

Series Shape(const WireState& state, const std::string& label, Mark mark, int color) {
  Series series{label, mark, {}, {}, {}, color};
  for (const Eigen::Vector3d& p : state.nodes()) {
    series.x.push_back(p[0]);
    series.y.push_back(p[1]);
  }
  return series;
}

void MeasureInsertion(PaperPart& part) {
  part.run.Section("Fast insertion (4.1)");
  Table table{"250 mm inserted at once, Tip Relaxations only",
              {"lambda, mm", "tip", "time, s", "speed, m/s", "deepest penetration, mm"},
              {}};
  for (const double lambda : kPaperSegmentsMm) {
    for (const double angle : {0.0, kPaperTipRad}) {
      const std::string tip = angle == 0 ? "straight" : "45 deg";
      const std::string name =
          "insertion/" + CaseOf(lambda) + (angle == 0 ? "/straight" : "/angled");
      std::vector<double> times;
      double deepest = 0;
      for (int repeat = 0; repeat < 5; ++repeat) {
        PaperBench bench(part.phantom, {.segment_mm = lambda, .tip_angle_rad = angle});
        times.push_back(bench.InsertFast());
        deepest = bench.deepest_mm();
      }
      const double time = Median(times);
      if (lambda == 1 && angle != 0) {
        part.comparison.Add("fast insertion, 250 segments", name, "time", 0.24, time, "s",
                            "processor; look-ups are skipped where contact is impossible");
      } else {
        part.run.Record(name, "time", time, "s");
      }
      part.run.Record(name, "deepest_penetration", deepest, "mm");
      table.rows.push_back(
          {Number(lambda), tip, Number(time), Number(0.25 / time), Number(deepest)});
    }
  }
  part.run.Show(table);

  PaperBench stiff(part.phantom,
                   {.segment_mm = 1, .tip_angle_rad = kPaperTipRad, .rigidity_N_mm2 = 6.35e1});
  stiff.InsertFast();
  part.run.Record("insertion/n=250/EI=1e4x", "deepest_penetration", stiff.deepest_mm(), "mm");
  part.run.Say("With a rigidity 10,000 times larger the wire leaves the lumen by up to " +
               Number(stiff.deepest_mm()) +
               " mm. The paper states this limit: a huge rigidity \"perforates\" the artery.");
}

// Predecessor's slow insertion with full cycles, which Tip Relaxations replace.
void MeasurePredecessor(PaperPart& part) {
  const double lambda = part.run.quick() ? 2.5 : 1;
  PaperBench bench(part.phantom, {.segment_mm = lambda, .law = BendingLaw::kG2});
  const WallModel wall{0.01, 1};
  PredecessorRelaxation relaxation(bench.model(), *part.phantom.field, wall, {});
  WireState state(bench.model());
  relaxation.Restart(state);
  const double before = ThreadCpuSeconds();
  TickReport report;
  for (double s = lambda; s <= PaperBench::kLengthMm; s += lambda) {
    CountedBudget budget(1000);
    report = relaxation.Tick({s, 0}, budget, state);
    part.run.Progress("insertion by the predecessor's model", 0.1 * s / PaperBench::kLengthMm);
  }
  const double slow = ThreadCpuSeconds() - before;
  PaperBench fast(part.phantom, {.segment_mm = lambda});
  const double quick = fast.InsertFast();
  const std::string name = "predecessor/" + CaseOf(lambda);
  part.run.Record(name, "time", slow, "s");
  part.run.Record(name, "ratio_to_tip_relaxations", slow / quick, "");
  part.run.Record(name, "deepest_penetration_at_end", report.max_penetration_mm, "mm");
  part.run.Say(
      "The predecessor's model (g2, signed denominator, no bound, feeds below lambda/10 at the "
      "base, each followed by a full cycle) takes " +
      Number(slow) + " s for the same insertion at lambda = " + Number(lambda) + " mm, " +
      Number(slow / quick) + " times as long as Tip Relaxations.");
}

struct Resolution {
  double lambda = 0;
  WireState inserted;     // the green curve of Fig. 12
  WireState relaxed;      // the blue curve of Fig. 12
  WireState equilibrium;  // by Newton's method
  double physical_s = 0;  // time of 100 cycles
  double geometrical_s = 0;
  double literal_s = 0;                                           // PR without skipped look-ups
  GeometricalInterval interval = {};                              // last interval of full length
  std::map<int, std::vector<double>> geometrical_by_length = {};  // s
};

// Times 100 cycles after the fast insertion. If that would take minutes, fewer are run and the time
// is scaled.
Resolution Relax(PaperPart& part, double lambda, double progress) {
  const PaperBench::Setup setup{.segment_mm = lambda, .tip_angle_rad = kPaperTipRad};
  PaperBench bench(part.phantom, setup);
  bench.InsertFast();
  Resolution r{.lambda = lambda,
               .inserted = bench.state(),
               .relaxed = bench.state(),
               .equilibrium = bench.state()};
  const int cycles = part.run.quick() && lambda < 1 ? 20 : kCycles;
  for (int k = 0; k < cycles; ++k) {
    part.run.Progress("cycles at " + CaseOf(lambda), progress + 0.12 * k / cycles);
    const PaperCycle cycle = bench.Cycle(true);
    r.physical_s += cycle.physical_s;
    r.geometrical_s += cycle.geometrical_s;
    if (cycle.interval.length() == 0) continue;
    r.interval = cycle.interval;
    r.geometrical_by_length[cycle.interval.length()].push_back(cycle.geometrical_s);
  }
  const double scale = static_cast<double>(kCycles) / cycles;
  r.physical_s *= scale;
  r.geometrical_s *= scale;
  r.relaxed = bench.state();
  r.equilibrium = bench.Equilibrium(nullptr);

  PaperBench::Setup literal = setup;
  literal.physical.skip_lookups = false;
  PaperBench unaccelerated(part.phantom, literal);
  unaccelerated.SetShape(r.inserted);
  const int some = lambda < 1 ? (part.run.quick() ? 1 : 4) : (part.run.quick() ? 8 : kCycles);
  for (int k = 0; k < some; ++k) {
    part.run.Progress("cycles without skipped look-ups at " + CaseOf(lambda),
                      progress + 0.12 + 0.08 * k / some);
    r.literal_s += unaccelerated.Cycle(false).physical_s * kCycles / some;
  }

  // Other thresholds for "near the wall" give intervals of other lengths.
  for (double near = 0.05; near < 2; near *= 1.25) {
    GeometricalSettings settings;
    settings.near_wall_mm = near;
    GeometricalRelaxation relaxation(bench.model(), *part.phantom.field, settings);
    for (int repeat = 0; repeat < 3; ++repeat) {
      WireState state = r.inserted;
      const double before = ThreadCpuSeconds();
      if (!relaxation.Begin(state)) break;
      relaxation.Continue(1 << 20, state);
      r.geometrical_by_length[relaxation.interval().length()].push_back(ThreadCpuSeconds() -
                                                                        before);
    }
  }
  return r;
}

// Times of 100 cycles against the number of segments; hundreds: N = n/100.
struct Growth {
  std::vector<double> hundreds;
  std::vector<double> physical_s;
  std::vector<double> literal_s;  // PR with every look-up
  std::vector<double> geometrical_s;
};

// Polynomial c[0] N^first + c[1] N^(first + 1).
struct Fit {
  std::vector<double> c;
  int first = 0;
};

// Fits (20) and (32) of the paper, s.
const Fit& PaperPhysicalFit() {
  static const Fit fit{{0.716, 0.310}, 2};
  return fit;
}
const Fit& PaperGeometricalFit() {
  static const Fit fit{{0.01875, 0.00323}, 1};
  return fit;
}

struct Fits {
  Fit physical, literal, geometrical;
};

Growth ReportTimes(PaperPart& part, const std::vector<Resolution>& resolutions) {
  Table table{"100 cycles after the fast insertion, s (Table 1)",
              {"n", "PR paper", "PR ours", "PR, every look-up", "GR paper", "GR ours",
               "PR/GR paper", "PR/GR ours"},
              {}};
  Growth growth;
  for (std::size_t k = 0; k < resolutions.size(); ++k) {
    const Resolution& r = resolutions[k];
    const PaperTimes& paper = kTable1[k];
    const std::string name = "table1/" + CaseOf(r.lambda);
    const std::string n = CaseOf(r.lambda).substr(2);
    part.comparison.Add("100 PR cycles, n = " + n, name, "pr", paper.physical_s, r.physical_s, "s",
                        "processor; look-ups are skipped where contact is impossible");
    part.run.Record(name, "pr_every_lookup", r.literal_s, "s");
    part.comparison.Add("100 GR cycles, n = " + n, name, "gr", paper.geometrical_s, r.geometrical_s,
                        "s", "processor; different intervals in a different artery");
    part.run.Record(name, "pr_over_gr", r.physical_s / r.geometrical_s, "");
    part.run.Record(name, "pr_over_gr_every_lookup", r.literal_s / r.geometrical_s, "");
    part.run.Record(name, "pr_over_gr_paper", paper.physical_s / paper.geometrical_s, "");
    table.rows.push_back({n, Number(paper.physical_s, 4), Number(r.physical_s), Number(r.literal_s),
                          Number(paper.geometrical_s), Number(r.geometrical_s),
                          Number(paper.physical_s / paper.geometrical_s),
                          Number(r.physical_s / r.geometrical_s)});
    growth.hundreds.push_back(PaperBench::kLengthMm / r.lambda / 100);
    growth.physical_s.push_back(r.physical_s);
    growth.literal_s.push_back(r.literal_s);
    growth.geometrical_s.push_back(r.geometrical_s);
  }
  part.run.Show(table);
  return growth;
}

Fits ReportFits(PaperPart& part, const Growth& growth) {
  const Fits fits{{FitPowers(growth.hundreds, growth.physical_s, {2, 3}), 2},
                  {FitPowers(growth.hundreds, growth.literal_s, {2, 3}), 2},
                  {FitPowers(growth.hundreds, growth.geometrical_s, {1, 2}), 1}};
  const auto record = [&](const std::string& name, const Fit& fit) {
    for (int k = 0; k < 2; ++k) {
      part.run.Record("fit33/" + name, "coefficient_of_N^" + std::to_string(fit.first + k),
                      fit.c[static_cast<std::size_t>(k)], "s");
    }
  };
  record("pr", fits.physical);
  record("pr_every_lookup", fits.literal);
  record("gr", fits.geometrical);
  part.run.Say(
      "Fits with N = n/100, least relative error. PR by (20): paper 0.716 N^2 + 0.310 N^3; "
      "ours " +
      Number(fits.physical.c[0]) + " N^2 + " + Number(fits.physical.c[1]) +
      " N^3; with every look-up " + Number(fits.literal.c[0]) + " N^2 + " +
      Number(fits.literal.c[1]) + " N^3. GR by (32): paper 0.01875 N + 0.00323 N^2; ours " +
      Number(fits.geometrical.c[0]) + " N + " + Number(fits.geometrical.c[1]) + " N^2.");
  return fits;
}

void ReportExponents(PaperPart& part, const Growth& growth, const Growth& paper) {
  const auto exponent = [&](const std::vector<double>& t, std::size_t from) {
    return std::log(t[from + 1] / t[from]) / std::log(2.5);
  };
  for (std::size_t k = 0; k < 2; ++k) {
    const std::string step = k == 0 ? "n = 100 to 250" : "n = 250 to 625";
    const std::string name = k == 0 ? "exponent/100-250" : "exponent/250-625";
    part.comparison.Add("exponent of PR time, " + step, name, "pr", exponent(paper.physical_s, k),
                        exponent(growth.physical_s, k), "",
                        "skipped look-ups save more in long wires");
    part.comparison.Add("exponent of PR time, every look-up", name, "pr_every_lookup",
                        exponent(paper.physical_s, k), exponent(growth.literal_s, k), "",
                        "n^3: look-ups dominate; the paper's have a larger n^2 part");
    part.comparison.Add("exponent of GR time, " + step, name, "gr",
                        exponent(paper.geometrical_s, k), exponent(growth.geometrical_s, k), "",
                        "chosen intervals");
  }
}

void DrawGrowth(PaperPart& part, const Growth& growth, const Growth& paper, const Fits& fits) {
  Plot plot;
  plot.title = "100 cycles against the number of segments (Table 1, eq. 33)";
  plot.x = {"segments n", true, {}};
  plot.y = {"processor time, s", true, {}};
  std::vector<double> n;
  for (const double h : growth.hundreds) n.push_back(100 * h);
  const auto curve = [&](const Fit& fit, int color) {
    Series series{"", Mark::kDashed, {}, {}, {}, color};
    for (double h = 0.8; h < 8; h *= 1.1) {
      series.x.push_back(100 * h);
      series.y.push_back(fit.c[0] * std::pow(h, fit.first) + fit.c[1] * std::pow(h, fit.first + 1));
    }
    plot.series.push_back(series);
  };
  curve(PaperPhysicalFit(), 7);
  curve(PaperGeometricalFit(), 7);
  curve(fits.literal, 1);
  curve(fits.physical, 0);
  curve(fits.geometrical, 2);
  plot.series.push_back({"paper (PR above, GR below)", Mark::kPoints, n, paper.physical_s, {}, 7});
  plot.series.push_back({"", Mark::kPoints, n, paper.geometrical_s, {}, 7});
  plot.series.push_back({"PR, every look-up", Mark::kPoints, n, growth.literal_s, {}, 1});
  plot.series.push_back({"PR", Mark::kPoints, n, growth.physical_s, {}, 0});
  plot.series.push_back({"GR", Mark::kPoints, n, growth.geometrical_s, {}, 2});
  part.run.Draw(plot,
                "Points are measured; dashed lines are fits. The growth agrees with the paper: PR "
                "grows between n^2 and n^3, GR between n and n^2. Their difference increases with "
                "each refinement.");
}

void ReportTable1(PaperPart& part, const std::vector<Resolution>& resolutions) {
  part.run.Section("Processing time of PR and GR (4.3)");
  Growth paper;
  for (const PaperTimes& times : kTable1) {
    paper.physical_s.push_back(times.physical_s);
    paper.geometrical_s.push_back(times.geometrical_s);
  }
  const Growth growth = ReportTimes(part, resolutions);
  const Fits fits = ReportFits(part, growth);
  ReportExponents(part, growth, paper);
  DrawGrowth(part, growth, paper, fits);
}

void ReportShapes(PaperPart& part, const std::vector<Resolution>& resolutions) {
  part.run.Section("Segment size (4.2)");
  const Resolution& a = resolutions[0];
  const Resolution& b = resolutions[1];
  const double share = (a.physical_s + a.geometrical_s) / (b.physical_s + b.geometrical_s);
  part.comparison.Add("time of lambda = 2.5 mm over lambda = 1 mm (Fig. 13)", "figure13",
                      "time_share", 11, 100 * share, "%", "see the exponents");

  Plot plot;
  plot.title = "The wire in the phantom (Figs. 12 and 13)";
  plot.x.label = "x, mm";
  plot.y.label = "y, mm";
  plot.equal_scales = true;
  plot.width = 600;
  plot.height = 660;
  plot.series.push_back(Lumen(part.phantom));
  plot.series.push_back(Shape(b.inserted, "after fast insertion, n = 250", Mark::kLine, 2));
  plot.series.push_back(Shape(a.relaxed, "100 cycles, n = 100", Mark::kLine, 3));
  plot.series.push_back(Shape(b.relaxed, "100 cycles, n = 250", Mark::kLine, 0));
  plot.series.push_back(Shape(b.equilibrium, "equilibrium (Newton)", Mark::kDashed, 1));
  for (const int node : {b.interval.mu, b.interval.nu}) {
    const Eigen::Vector3d& p = b.relaxed.nodes()[static_cast<std::size_t>(node)];
    plot.callouts.push_back({p[0], p[1], node == b.interval.mu ? "mu" : "nu"});
  }
  part.run.Draw(plot,
                "The phantom from above; its far part rises out of the plane. mu and nu: interval "
                "of the last Geometrical Relaxation at n = 250, nodes " +
                    std::to_string(b.interval.mu) + " to " + std::to_string(b.interval.nu) +
                    "; at n = 100 it was " + std::to_string(a.interval.mu) + " to " +
                    std::to_string(a.interval.nu) + ".");
  for (const Resolution& r : resolutions) {
    part.run.Record("shape/" + CaseOf(r.lambda), "distance_of_100_cycles_to_equilibrium",
                    MeanDistance(r.relaxed, r.equilibrium), "mm");
    part.run.Record("shape/" + CaseOf(r.lambda), "distance_of_insertion_to_equilibrium",
                    MeanDistance(r.inserted, r.equilibrium), "mm");
  }
}

void ReportIntervals(PaperPart& part, const std::vector<Resolution>& resolutions) {
  part.run.Section("Time of a Geometrical Relaxation (Fig. 14)");
  Plot plot;
  plot.title = "One GR cycle against the length of its interval (Fig. 14, eq. 34)";
  plot.x.label = "nu - mu, segments";
  plot.y.label = "processor time, ms";
  std::array<double, 2> quadratic{};
  for (std::size_t k = 0; k < 2; ++k) {
    const Resolution& r = resolutions[k + 1];
    const std::string name = CaseOf(r.lambda);
    Series points{
        name.substr(0, 1) + " = " + name.substr(2), Mark::kPoints, {}, {}, {}, static_cast<int>(k)};
    for (const auto& [length, times] : r.geometrical_by_length) {
      points.x.push_back(length);
      points.y.push_back(1e3 * Median(times));
    }
    const std::vector<double> c = FitPowers(points.x, points.y, {0, 1, 2});
    for (std::size_t p = 0; p < 3; ++p) {
      part.run.Record("fit34/" + name, "t_" + std::to_string(p), 1e3 * c[p], "us");
    }
    quadratic[k] = c[2];
    Series line{"", Mark::kDashed, {}, {}, {}, static_cast<int>(k)};
    const double last = points.x.back();
    for (int s = 0; s <= 60; ++s) {
      const double x = last * s / 60;
      line.x.push_back(x);
      line.y.push_back(c[0] + c[1] * x + c[2] * x * x);
    }
    plot.series.push_back(line);
    plot.series.push_back(points);
  }
  part.comparison.Add("quadratic coefficients of (34), n = 250 over n = 625", "fit34",
                      "quadratic_ratio", 0.003663 / 0.003586, quadratic[0] / quadratic[1], "",
                      "expected 1, because an update costs the same in any wire");
  part.run.Draw(plot,
                "Medians over cycles of equal length; dashed: fits of (34). An update costs " +
                    Number(1e3 * quadratic[1]) +
                    " us for any number of segments. Lengths that the workflow did not choose were "
                    "measured with other thresholds for contact.");
}

}  // namespace

void MeasurePaperTimes(PaperPart& part) {
  MeasureInsertion(part);
  MeasurePredecessor(part);
  std::vector<Resolution> resolutions;
  for (const double lambda : kPaperSegmentsMm) {
    resolutions.push_back(Relax(part, lambda, 0.1 + 0.2 * static_cast<double>(resolutions.size())));
  }
  ReportTable1(part, resolutions);
  ReportShapes(part, resolutions);
  ReportIntervals(part, resolutions);
}

}  // namespace torquer::study
