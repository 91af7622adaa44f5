#include "host/study/experiments.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <numbers>
#include <string>
#include <vector>

#include "host/simulator/vessel/phantoms.h"
#include "host/study/experiment_data.h"
#include "host/study/experiment_rods.h"
#include "host/study/paper_bench.h"
#include "host/study/wire_comparison.h"

namespace torquer::study {
namespace {

constexpr double kNotStated = std::numeric_limits<double>::quiet_NaN();

// Value with its error: one standard deviation, or kNotStated.
struct Estimate {
  double value = 0;
  double error = kNotStated;
};

std::string Text(const Estimate& e) {
  return Number(e.value, 4) + (std::isnan(e.error) ? "" : " +- " + Number(e.error, 2));
}

// Difference of two values, in units of their combined error.
double Apart(const Estimate& ours, const Estimate& theirs) {
  const double stated = std::isnan(theirs.error) ? 0 : theirs.error;
  return (ours.value - theirs.value) / std::hypot(ours.error, stated);
}

// Evaluates the model `at` with a segment length. The error is the change from halving the
// segments.
template <class Model>
Estimate Refined(double segment_mm, const Model& at) {
  const double fine = at(segment_mm / 2);
  return {fine, std::abs(fine - at(segment_mm))};
}

double Mean(const std::vector<double>& values) {
  double sum = 0;
  for (const double v : values) sum += v;
  return sum / static_cast<double>(values.size());
}

// Sample standard deviation: divides by the number of values less one.
double Deviation(const std::vector<double>& values) {
  const double mean = Mean(values);
  double sum = 0;
  for (const double v : values) sum += (v - mean) * (v - mean);
  return std::sqrt(sum / (static_cast<double>(values.size()) - 1));
}

class Comparison {
 public:
  explicit Comparison(StudyRun& run) : run_(run) {}

  void Add(const std::string& experiment, const std::string& quantity, const Estimate& theirs,
           const Estimate& ours, const std::string& unit) {
    Put(experiment, quantity, theirs, ours, unit);
    const double apart = Apart(ours, theirs);
    run_.Record(experiment + "/" + quantity, "apart", apart, "");
    table_.rows.back().push_back(Number(apart, 2));
  }
  // Adds values of different meaning: only their magnitudes can be compared.
  void AddSize(const std::string& experiment, const std::string& quantity, const Estimate& theirs,
               const Estimate& ours, const std::string& unit) {
    Put(experiment, quantity, theirs, ours, unit);
    table_.rows.back().emplace_back("sizes only");
  }
  const Table& table() const { return table_; }

 private:
  void Put(const std::string& experiment, const std::string& quantity, const Estimate& theirs,
           const Estimate& ours, const std::string& unit) {
    const std::string name = experiment + "/" + quantity;
    run_.Record(name, "theirs", theirs.value, unit);
    run_.Record(name, "theirs_error", theirs.error, unit);
    run_.Record(name, "ours", ours.value, unit);
    run_.Record(name, "ours_error", ours.error, unit);
    table_.rows.push_back({experiment + ": " + quantity, Text(theirs), Text(ours), unit});
  }

  StudyRun& run_;
  Table table_{"Published and simulated experiments",
               {"experiment: quantity", "published", "ours", "unit", "apart, in errors"},
               {}};
};

struct ExperimentOutput {
  StudyRun& run;
  Comparison& comparison;
};

// Series for points with an error in x or y: the points, and an error bar for each.
std::array<Series, 2> WithErrors(const std::string& label, const std::vector<double>& x,
                                 const std::vector<double>& y, const std::vector<double>& x_error,
                                 const std::vector<double>& y_error, int color) {
  Series bars{"", Mark::kLine, {}, {}, {}, color};
  for (std::size_t k = 0; k < x.size(); ++k) {
    bars.x.insert(bars.x.end(), {x[k] - x_error[k], x[k] + x_error[k], kNotStated});
    bars.y.insert(bars.y.end(), {y[k] - y_error[k], y[k] + y_error[k], kNotStated});
  }
  return {bars, Series{label, Mark::kPoints, x, y, {}, color}};
}

void BendStrip(ExperimentOutput& output) {
  output.run.Section("A steel strip under weights (Belendez, Neipp and Belendez 2003)");
  output.run.Say(
      "A steel strip of 400 x 25 x 0.4 mm is clamped level. Weights bend its end down by up to 0.7 "
      "of its length. Assumptions: readings and length are accurate to 1 mm, because no error is "
      "stated. E = 194.3 GPa is the authors' value for this strip, so only the shape of the curve "
      "is a test. Our error: difference to halved segments, and to a length changed by 1 mm.");
  constexpr double kRigidity = 1e3 * strip::kYoungGPa * strip::kWidthMm * strip::kThicknessMm *
                               strip::kThicknessMm * strip::kThicknessMm / 12;
  constexpr double kCutMm = 2;
  const auto tip_mm = [&](double force_N, double length_mm, double cut_mm) {
    return Bend({length_mm, kRigidity, strip::kWeightN / strip::kLengthMm, force_N}, cut_mm)
        .deflection_mm;
  };
  std::vector<double> force, measured, error, none;
  for (const strip::Reading& reading : strip::kReadings) {
    output.run.Progress("strip", 0.1 * reading.force_N / strip::kReadings.back().force_N);
    Estimate ours = Refined(
        kCutMm, [&](double cut_mm) { return tip_mm(reading.force_N, strip::kLengthMm, cut_mm); });
    // Changes the length of each segment, not their number.
    const auto by_length = [&](double change_mm) {
      const double length_mm = strip::kLengthMm + change_mm;
      return tip_mm(reading.force_N, length_mm, kCutMm * length_mm / strip::kLengthMm);
    };
    ours.error =
        std::hypot(ours.error, (by_length(strip::kReadingMm) - by_length(-strip::kReadingMm)) / 2);
    output.comparison.Add("strip", "end down, " + Number(reading.force_N) + " N",
                          {reading.measured_mm, strip::kReadingMm}, ours, "mm");
    force.push_back(reading.force_N);
    measured.push_back(reading.measured_mm);
    error.push_back(strip::kReadingMm);
    none.push_back(0);
  }
  Plot plot;
  plot.title = "A steel strip under weights";
  plot.x.label = "force on the end, N";
  plot.y.label = "end below the clamp, mm";
  Series line{"ours", Mark::kLine, {}, {}, {}, 0};
  for (int k = 0; k <= 24; ++k) {
    const double force_N = strip::kReadings.back().force_N * k / 24;
    line.x.push_back(force_N);
    line.y.push_back(tip_mm(force_N, strip::kLengthMm, kCutMm));
  }
  plot.series.push_back(line);
  for (Series& s : WithErrors("measured", force, measured, none, error, 1)) {
    plot.series.push_back(std::move(s));
  }
  output.run.Draw(plot, "Error bars of 1 mm are smaller than the points.");
}

// Sensor noise: root mean square of the reading across the bend, which is ideally zero.
double SensorNoise(std::size_t sensor) {
  double sum = 0;
  for (const needle::Insertion& insertion : needle::kInsertions) {
    sum += std::pow(insertion.out_of_plane_1_per_mm[sensor], 2);
  }
  return std::sqrt(sum / static_cast<double>(needle::kInsertions.size()));
}

void BendNeedle(ExperimentOutput& output) {
  output.run.Section("A needle bent in a phantom (J. S. Kim)");
  output.run.Say(
      "A steel needle, 0.9 mm thick, is 90 mm deep in a phantom that bends it to one side. The "
      "curvature at the first sensor, 20 mm from the entry, sets the load. The simulator predicts "
      "the deflection of the tip and the curvature at 64 mm. Assumptions: the needle is clamped at "
      "the entry and has a uniform transverse load, as in the authors' model. E = 200 GPa cancels "
      "out. Our error: difference to halved segments, and the sensor's reading across the bend, "
      "which should be zero. The authors state no error of the tip.");
  const double rigidity =
      1e3 * needle::kYoungGPa * std::numbers::pi * std::pow(needle::kDiameterMm, 4) / 64;
  constexpr double kCutMm = 1;
  const ClampedRod rod{.length_mm = needle::kLengthMm, .rigidity_N_mm2 = rigidity};
  const std::array<double, 2> noise = {SensorNoise(0), SensorNoise(1)};
  std::vector<double> seen, tip, seen_error, none, far, ours_far, ratio;
  for (const needle::Insertion& insertion : needle::kInsertions) {
    const double curvature = insertion.in_plane_1_per_mm[0];
    const auto tip_mm = [&](double k, double cut_mm) {
      return BendTo(rod, k, needle::kSensorsMm[0], cut_mm).rod.deflection_mm;
    };
    Estimate ours = Refined(kCutMm, [&](double cut_mm) { return tip_mm(curvature, cut_mm); });
    ours.error =
        std::hypot(ours.error, tip_mm(curvature + noise[0], kCutMm) - tip_mm(curvature, kCutMm));
    output.comparison.Add("needle", "tip off, insertion " + std::to_string(seen.size() + 1),
                          {insertion.tip_mm, kNotStated}, ours, "mm");
    seen.push_back(1e3 * curvature);
    seen_error.push_back(1e3 * noise[0]);
    tip.push_back(insertion.tip_mm);
    none.push_back(0);
    far.push_back(1e3 * insertion.in_plane_1_per_mm[1]);
    ours_far.push_back(1e3 * BendTo(rod, curvature, needle::kSensorsMm[0], kCutMm)
                                 .rod.CurvatureAt(needle::kSensorsMm[1]));
    ratio.push_back(ours.value / insertion.tip_mm);
  }
  // The load is uniform, so an error of the first sensor propagates in proportion.
  const double passed_on = 1e3 * noise[0] * Mean(ours_far) / Mean(seen);
  output.comparison.Add("needle", "curvature at 64 mm, mean", {Mean(far), 1e3 * noise[1]},
                        {Mean(ours_far), passed_on}, "1/m");
  output.run.Record("needle", "tip_ratio_mean", Mean(ratio), "");
  output.run.Record("needle", "tip_ratio_deviation", Deviation(ratio), "");
  output.run.Say("Ratio of our tip deflection to theirs: " + Number(Mean(ratio)) + " +- " +
                 Number(Deviation(ratio), 2) +
                 ". This is one systematic difference in seven cases, not seven errors.");
  Plot plot;
  plot.title = "A needle bent in a phantom";
  plot.x.label = "curvature 20 mm from the entry, 1/m";
  plot.y.label = "deflection of the tip, mm";
  Series line{"ours", Mark::kLine, {}, {}, {}, 0};
  for (const double k : {1.0e-3, 1.2e-3, 1.4e-3, 1.6e-3}) {
    line.x.push_back(1e3 * k);
    line.y.push_back(BendTo(rod, k, needle::kSensorsMm[0], kCutMm).rod.deflection_mm);
  }
  plot.series.push_back(line);
  for (Series& s : WithErrors("measured", seen, tip, seen_error, none, 1)) {
    plot.series.push_back(std::move(s));
  }
  output.run.Draw(plot, "Error bars: the sensor's reading across the bend, which should be zero.");
}

double PeakStress(const columns::Bar& bar, double slenderness, int segments) {
  const double length_mm = slenderness * std::sqrt(bar.second_moment_mm4 / bar.area_mm2);
  const double rigidity = 1e3 * bar.young_GPa * bar.second_moment_mm4;
  return BucklingForce(length_mm, rigidity, segments) / bar.area_mm2;
}

void PressColumns(ExperimentOutput& output) {
  output.run.Section("Bars pressed between clamps (A. Claux)");
  output.run.Say(
      "Round bars of 6 mm are 240 to 500 mm long. Assumptions: the ends neither turn nor move "
      "sideways, the bars are straight, the moduli are nominal, and nothing yields. Only bars with "
      "a computed stress below half of that in the metal's shortest bar are compared. No error is "
      "stated and each bar was pressed once. Their error is thus the scatter of the six bars about "
      "the common ratio. Our error: difference to halved segments.");
  constexpr int kSegments = 100;
  struct Pair {
    const columns::Specimen* specimen;
    Estimate ours;
  };
  std::vector<Pair> pairs;
  std::vector<double> ratios;
  for (const columns::Specimen& specimen : columns::kSpecimens) {
    output.run.Progress("columns", 0.4 + 0.02 * static_cast<double>(pairs.size()));
    const double coarse = PeakStress(specimen.bar, specimen.slenderness, kSegments);
    const double fine = PeakStress(specimen.bar, specimen.slenderness, 2 * kSegments);
    pairs.push_back({&specimen, {fine, std::abs(fine - coarse)}});
    ratios.push_back(specimen.peak_MPa / fine);
  }
  const double scatter = Deviation(ratios);
  output.run.Record("columns", "theirs_over_ours_mean", Mean(ratios), "");
  output.run.Record("columns", "theirs_over_ours_deviation", scatter, "");
  output.run.Say("Theirs over ours: " + Number(Mean(ratios)) + " +- " + Number(scatter, 2) + ".");
  Plot plot;
  plot.title = "Bars pressed between clamps";
  plot.x = {"length over radius of gyration", true, {}};
  plot.y = {"peak stress, MPa", true, {}};
  int color = 0;
  for (const columns::Bar* bar : {&columns::kAluminum, &columns::kSteel}) {
    Series line{std::string("ours, ") + bar->metal, Mark::kLine, {}, {}, {}, color};
    std::vector<double> x, y, y_error, none;
    for (const Pair& pair : pairs) {
      const columns::Specimen& specimen = *pair.specimen;
      if (&specimen.bar != bar) continue;
      const double error = scatter * specimen.peak_MPa;
      output.comparison.Add(
          "columns", std::string(bar->metal) + ", slenderness " + Number(specimen.slenderness),
          {specimen.peak_MPa, error}, pair.ours, "MPa");
      line.x.push_back(specimen.slenderness);
      line.y.push_back(pair.ours.value);
      x.push_back(specimen.slenderness);
      y.push_back(specimen.peak_MPa);
      y_error.push_back(error);
      none.push_back(0);
    }
    plot.series.push_back(line);
    for (Series& s :
         WithErrors(std::string("measured, ") + bar->metal, x, y, none, y_error, color)) {
      plot.series.push_back(std::move(s));
    }
    ++color;
  }
  output.run.Draw(plot,
                  "Error bars: scatter of the six bars about their common ratio to our results.");
}

// Equilibrium of the paper's wire in our phantom, near a given shape.
struct Resting {
  PaperBench bench;
  WireState state;
  bool converged = false;

  Resting(const vessel::TubeVessel& vessel, const PaperBench::Setup& setup, const WireState& near)
      : bench(vessel, setup), state(bench.model()) {
    bench.SetShape(Recut(bench.model(), near));
    state = bench.Equilibrium(&converged);
  }
};

bool LayInPhantom(ExperimentOutput& output) {
  output.run.Section("A guidewire in a phantom (Baier et al. 2016, Fig. 12)");
  output.run.Say(
      "The paper inserts a wire of 250 mm into a stiff phantom with a T and a Y. The wire is 0.262 "
      "+- 0.227 mm (standard deviation along the wire) from the simulated wire. The artery is "
      "published as a picture only, so the experiment cannot be repeated. This comparison gives "
      "the error of the method itself. It uses the paper's wire and method in our phantom of the "
      "same parts (lumen 8 mm). The reference is the same wire in equilibrium with fine segments. "
      "Assumptions: a straight wire, no friction, and a wall of 0.01 N/mm^2, which the paper does "
      "not give.");
  const bool quick = output.run.quick();
  const vessel::TubeVessel vessel = vessel::MakeTyPhantom();
  PaperBench theirs(vessel, {.segment_mm = phantom::kSegmentMm});
  theirs.InsertFast();
  for (int k = 0; k < phantom::kCycles; ++k) {
    output.run.Progress("phantom", 0.6 + 0.2 * k / phantom::kCycles);
    theirs.Cycle(true);
  }
  const double fine_mm = quick ? 0.5 : 0.2;
  const PaperBench::Setup fine_setup{.segment_mm = fine_mm, .law = BendingLaw::kExact};
  const Resting fine(vessel, fine_setup, theirs.state());
  const auto changed = [&](const auto& change) {
    PaperBench::Setup setup = fine_setup;
    change(setup);
    return Resting(vessel, setup, fine.state);
  };
  const Resting coarse = changed([](PaperBench::Setup& s) { s.segment_mm = phantom::kSegmentMm; });
  const Resting stiffer = changed([](PaperBench::Setup& s) { s.rigidity_N_mm2 *= 1.1; });
  const Resting harder = changed([](PaperBench::Setup& s) { s.wall_N_mm2 *= 10; });
  // A thinner wire has the same effect as a wider lumen.
  const Resting wider = changed([](PaperBench::Setup& s) { s.radius_mm -= 0.1; });
  const auto from_fine = [&](const PaperBench& bench, const WireState& state) {
    return Distances(bench.model(), state, fine.bench.model(), fine.state);
  };
  struct Wire {
    std::string name;
    std::string metric;
    std::vector<double> mm;
  };
  const Wire cases[] = {
      {"the paper's method, " + std::to_string(phantom::kCycles) + " cycles, 1 mm", "paper_method",
       from_fine(theirs, theirs.state())},
      {"ours, in equilibrium, 1 mm", "ours", from_fine(coarse.bench, coarse.state)},
      {"wire stiffer by a tenth", "stiffer_wire", from_fine(stiffer.bench, stiffer.state)},
      {"wall ten times as stiff", "harder_wall", from_fine(harder.bench, harder.state)},
      {"lumen radius larger by 0.1 mm", "wider_lumen", from_fine(wider.bench, wider.state)}};
  Table table{"Distance from a wire in equilibrium with segments of " + Number(fine_mm) + " mm, mm",
              {"wire", "mean", "deviation", "largest"},
              {}};
  for (const Wire& c : cases) {
    const double largest = *std::max_element(c.mm.begin(), c.mm.end());
    output.run.Record("phantom/" + c.metric, "mean", Mean(c.mm), "mm");
    output.run.Record("phantom/" + c.metric, "deviation", Deviation(c.mm), "mm");
    output.run.Record("phantom/" + c.metric, "largest", largest, "mm");
    table.rows.push_back({c.name, Number(Mean(c.mm)), Number(Deviation(c.mm)), Number(largest)});
  }
  output.run.Show(table);
  output.comparison.AddSize("phantom", "real wire; the paper's method",
                            {phantom::kMeanMm, phantom::kDeviationMm},
                            {Mean(cases[0].mm), Deviation(cases[0].mm)}, "mm");
  output.comparison.AddSize("phantom", "real wire; ours, 1 mm",
                            {phantom::kMeanMm, phantom::kDeviationMm},
                            {Mean(cases[1].mm), Deviation(cases[1].mm)}, "mm");
  Plot plot;
  plot.title = "A guidewire in a phantom";
  plot.x.label = "distance from the tip, mm";
  plot.y.label = "distance from the wire in equilibrium, mm";
  int color = 0;
  for (const Wire& c : cases) {
    Series line{c.name, Mark::kLine, {}, c.mm, {}, color++};
    for (std::size_t k = 0; k < c.mm.size(); ++k) line.x.push_back(0.5 * static_cast<double>(k));
    plot.series.push_back(line);
  }
  plot.series.push_back({"the paper's real wire, mean",
                         Mark::kDashed,
                         {0, PaperBench::kLengthMm},
                         {phantom::kMeanMm, phantom::kMeanMm},
                         {},
                         color});
  output.run.Draw(plot, "A distance well below the dashed line is too small to explain it.");
  return fine.converged && coarse.converged && stiffer.converged && harder.converged &&
         wider.converged;
}

class ExperimentsStudy final : public Study {
 public:
  std::string name() const override { return "experiments"; }
  std::string title() const override { return "Published experiments compared with the simulator"; }
  std::string summary() const override {
    return "published experiments on wires and rods, compared with the simulator's results";
  }
  bool Run(StudyRun& run) override {
    run.Say(
        "Errors are standard deviations. The last column is our value minus theirs, divided by the "
        "root of the sum of both squared errors. An unstated error counts as zero.");
    Comparison comparison(run);
    ExperimentOutput output{run, comparison};
    BendStrip(output);
    BendNeedle(output);
    PressColumns(output);
    const bool rests = LayInPhantom(output);
    run.ShowFirst(comparison.table());
    return rests;
  }
};

}  // namespace

std::unique_ptr<Study> MakeExperimentsStudy() { return std::make_unique<ExperimentsStudy>(); }

}  // namespace torquer::study
