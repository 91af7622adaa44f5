#include "host/tools/calibrate_report.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <vector>

#include "calibration/fit.h"
#include "host/plot/svg_plot.h"
#include "host/plot/table.h"
#include "host/support/angle.h"

namespace torquer::tools {
namespace {

using calibration::Estimate;
using calibration::HandMotion;
using calibration::MotionFit;
using calibration::MotionKind;
using calibration::ProcedureResult;
using calibration::ProcedureSettings;

// Height gain above which the verdict names the height: as much as 1.5 mm in 150 mm.
constexpr double kNotableHeightGain = 0.01;

// Used strokes of one kind: their number in the run, and their residuals.
struct Residuals {
  std::vector<int> number;
  std::vector<double> insertion_mm;
  std::vector<double> rotation_deg;
};

Residuals ResidualsOf(const ProcedureResult& result, MotionKind kind) {
  Residuals residuals;
  int number = 0;
  std::size_t used = 0;
  for (std::size_t i = 0; i < result.strokes.size(); ++i) {
    const bool mine = result.strokes[i].stroke.kind == kind;
    number += mine;
    if (result.rejections[i]) continue;
    const HandMotion& residual = result.fit.residuals[used++];
    if (!mine) continue;
    residuals.number.push_back(number);
    residuals.insertion_mm.push_back(residual.insertion_mm);
    residuals.rotation_deg.push_back(residual.rotation_rad * kDegreesPerRad);
  }
  return residuals;
}

// Half width of an axis that holds all values: 1, 2 or 5 times a power of ten.
double RoundLimit(const std::vector<double>& values) {
  double largest = 1e-3;
  for (const double value : values) largest = std::max(largest, std::abs(value));
  const double decade = std::pow(10.0, std::floor(std::log10(largest)));
  for (const double step : {1.0, 2.0, 5.0}) {
    if (largest <= step * decade) return step * decade;
  }
  return 10.0 * decade;
}

std::string Strip(double value, double limit, int width) {
  std::string strip(static_cast<std::size_t>(width), ' ');
  const auto at = [&](double v) {
    return static_cast<std::size_t>(std::lround((v / limit + 1.0) / 2.0 * (width - 1)));
  };
  strip[at(0.0)] = ':';
  strip[at(std::clamp(value, -limit, limit))] = '*';
  return "|" + strip + "|";
}

std::string Chart(const Residuals& residuals, const char* name, int columns) {
  const int width = std::max(11, (columns - 34) / 2);
  const double mm = RoundLimit(residuals.insertion_mm);
  const double degrees = RoundLimit(residuals.rotation_deg);
  const auto head = [&](double limit, const char* unit) {
    return fmt::format("{:<8}{:>{}}{:>8}", fmt::format("{:+.2g}", -limit),
                       fmt::format("0 {}", unit), std::max(0, width - 14),
                       fmt::format("{:+.2g}", limit));
  };
  std::string text =
      fmt::format("  {:<9} {}           {}\n", name, head(mm, "mm"), head(degrees, "deg"));
  for (std::size_t i = 0; i < residuals.number.size(); ++i) {
    text +=
        fmt::format("  {:6}   {} {:+6.2f}  {} {:+6.2f}\n", residuals.number[i],
                    Strip(residuals.insertion_mm[i], mm, width), residuals.insertion_mm[i],
                    Strip(residuals.rotation_deg[i], degrees, width), residuals.rotation_deg[i]);
  }
  return text;
}

std::string Row(const char* name, const Estimate& estimate, double unit, const char* unit_name) {
  return fmt::format("  {:<16} {:10.4f} {:<12} standard error {:.4f}, 95 % within {:.4f}\n", name,
                     estimate.value * unit, unit_name, estimate.standard_error * unit,
                     estimate.HalfWidth95() * unit);
}

struct Panel {
  const char* title;
  const char* unit;
  const std::vector<double>& values;
  const std::vector<int>& number;
  double scatter;
  double degrees_of_freedom;
};

std::string DrawPanel(const Panel& panel) {
  plot::Plot picture;
  picture.title = panel.title;
  picture.width = 450;
  picture.height = 300;
  std::vector<double> x(panel.number.begin(), panel.number.end());
  const double last = x.empty() ? 1.0 : x.back();
  picture.x = {.label = "stroke", .range = std::pair{0.0, last + 1.0}};
  const double band = panel.scatter * calibration::StudentHalfWidth95(panel.degrees_of_freedom);
  const double limit = 1.15 * std::max(band, RoundLimit(panel.values));
  picture.y = {.label = std::string("reference less model, ") + panel.unit,
               .range = std::pair{-limit, limit}};
  const auto line = [&](double at, plot::Mark mark, int color, const char* label) {
    picture.series.push_back(
        {.label = label, .mark = mark, .x = {0.0, last + 1.0}, .y = {at, at}, .color = color});
  };
  line(0.0, plot::Mark::kLine, 7, "");
  line(band, plot::Mark::kDashed, 1, "95 % of strokes");
  line(-band, plot::Mark::kDashed, 1, "");
  picture.series.push_back(
      {.label = "", .mark = plot::Mark::kPoints, .x = x, .y = panel.values, .color = 0});
  return plot::DrawPlot(picture);
}

}  // namespace

Grade GradeOf(const MotionFit& fit) {
  const double mm = fit.push_error_mm.HalfWidth95();
  const double degrees = fit.turn_error_rad.HalfWidth95() * kDegreesPerRad;
  if (mm <= 2.0 && degrees <= 3.0) return Grade::kGood;
  return mm <= 6.0 && degrees <= 10.0 ? Grade::kUsable : Grade::kPoor;
}

std::string ParameterTable(const ProcedureResult& result) {
  const MotionFit& fit = result.fit;
  return Row("gain", fit.gain_mm_per_count, 1000.0, "um a count") +
         Row("misalignment", fit.misalignment_rad, kDegreesPerRad, "degrees") +
         Row("cylinder radius", fit.cylinder_radius_mm, 1.0, "mm") +
         Row("skew", fit.skew_rad, kDegreesPerRad, "degrees") +
         fmt::format("  {:<16} {:10.4f} %            {}\n", "height",
                     100 * fit.height_gain.HalfWidth95(),
                     fit.height_measured ? "largest change, from the raised pushes"
                                         : "largest change, by the declared play") +
         fmt::format(
             "  the pushes began {:+.2f} mm from the first at last; surface quality {:.0f}\n",
             result.return_mm, result.mean_surface_quality);
}

std::string ResidualChart(const ProcedureResult& result, int columns) {
  return Chart(ResidualsOf(result, MotionKind::kPush), "push", columns) +
         Chart(ResidualsOf(result, MotionKind::kTurn), "turns", columns);
}

std::string Verdict(const ProcedureResult& result, const ProcedureSettings& settings) {
  const MotionFit& fit = result.fit;
  std::string text = fmt::format(
      "A push of {:.0f} mm is measured to within {:.2f} mm, a whole turn to within {:.2f} degrees\n"
      "(95 %). Such a push shows as at most {:.2f} degrees of turning, a turn as {:.2f} mm of "
      "pushing.\n",
      calibration::kFigureStrokeMm, fit.push_error_mm.HalfWidth95(),
      fit.turn_error_rad.HalfWidth95() * kDegreesPerRad,
      fit.push_turns_rad.HalfWidth95() * kDegreesPerRad, fit.turn_pushes_mm.HalfWidth95());
  switch (GradeOf(fit)) {
    case Grade::kGood:
      text += "That is good.\n";
      break;
    case Grade::kUsable:
      text += "That is usable.\n";
      break;
    case Grade::kPoor:
      text += "The calibration is too inaccurate, so it is not saved.\n";
      break;
  }
  if (fit.height_gain.bound > kNotableHeightGain) {
    text +=
        fit.height_measured
            ? fmt::format(
                  "Raised, the cylinder counts {:+.1f} %: reduce its play (hardware/README.md), "
                  "and calibrate again.\n",
                  100 * fit.height_gain.value)
            : fmt::format(
                  "Up to {:.1f} % of this is the height of the cylinder, which was not "
                  "measured: make the raised\npushes, or declare the play of a preloaded "
                  "cylinder (--play).\n",
                  100 * fit.height_gain.bound);
  }
  if (GradeOf(fit) != Grade::kGood) {
    if (fit.push_error_mm.HalfWidth95() > 2.0) {
      text += fit.push_declared_share > 0.5
                  ? fmt::format(
                        "Most of the error of a push is that of the declared length: measure it "
                        "more closely\nthan to {:.2g} mm, or push farther.\n",
                        settings.length_error_mm)
                  : fmt::format(
                        "The pushes scatter by {:.2f} mm: go straight from end to end, and take "
                        "more (--pushes).\n",
                        fit.push_scatter.insertion_mm);
    }
    if (fit.turn_error_rad.HalfWidth95() * kDegreesPerRad > 3.0) {
      text += fmt::format(
          "The turns scatter by {:.1f} degrees: set line to mark more closely, and turn more "
          "(--turns).\n",
          fit.turn_scatter.rotation_rad * kDegreesPerRad);
    }
  }
  const double begun_apart_mm = std::abs(result.return_mm);
  if (begun_apart_mm > std::max(1.0, 6.0 * fit.push_scatter.insertion_mm)) {
    text += fmt::format(
        "The near end moved by {:.1f} mm from the first push to the last: something slips or "
        "drifts.\n",
        begun_apart_mm);
  }
  if (fit.push_scatter.rotation_rad > 3.0 * settings.push_turn_rad) {
    text += fmt::format(
        "The hand turned by {:.1f} degrees from push to push; steady it for a smaller error "
        "of the misalignment.\n",
        fit.push_scatter.rotation_rad * kDegreesPerRad);
  }
  if (std::abs(fit.misalignment_rad.value) * kDegreesPerRad > 5.0) {
    text += fmt::format(
        "The sensor is mounted askew by {:.1f} degrees. The calibration allows for it; "
        "setting it straight\nkeeps a lifted or worn bench closer to what was measured.\n",
        fit.misalignment_rad.value * kDegreesPerRad);
  }
  return text;
}

std::string ResidualPicture(const ProcedureResult& result, const std::string& heading) {
  const MotionFit& fit = result.fit;
  const Residuals pushes = ResidualsOf(result, MotionKind::kPush);
  const Residuals turns = ResidualsOf(result, MotionKind::kTurn);
  const double push_freedom = std::max(1.0, static_cast<double>(pushes.number.size()) - 1.0);
  const double turn_freedom = std::max(1.0, static_cast<double>(turns.number.size()) - 1.0);
  const std::array<std::string, 4> panels{
      DrawPanel({"Pushes: insertion", "mm", pushes.insertion_mm, pushes.number,
                 fit.push_scatter.insertion_mm, push_freedom}),
      DrawPanel({"Pushes: unwanted turning", "degrees", pushes.rotation_deg, pushes.number,
                 fit.push_scatter.rotation_rad * kDegreesPerRad, push_freedom}),
      DrawPanel({"Turns: rotation", "degrees", turns.rotation_deg, turns.number,
                 fit.turn_scatter.rotation_rad * kDegreesPerRad, turn_freedom}),
      DrawPanel({"Turns: unwanted pushing", "mm", turns.insertion_mm, turns.number,
                 fit.turn_scatter.insertion_mm, turn_freedom})};
  const std::string second = fmt::format(
      "gain {:.3f} um a count, misalignment {:+.3f} deg, radius {:.4f} mm, skew {:+.3f} deg; 95 %: "
      "{:.2f} "
      "mm "
      "in 150 mm, {:.2f} deg in a turn",
      1000.0 * fit.gain_mm_per_count.value, kDegreesPerRad * fit.misalignment_rad.value,
      fit.cylinder_radius_mm.value, kDegreesPerRad * fit.skew_rad.value,
      fit.push_error_mm.HalfWidth95(), kDegreesPerRad * fit.turn_error_rad.HalfWidth95());
  std::string svg =
      "<svg xmlns=\"http://www.w3.org/2000/svg\" viewBox=\"0 0 920 670\" width=\"920\" "
      "height=\"670\" font-family=\"Inter, 'Segoe UI', 'DejaVu Sans', sans-serif\">\n"
      "<rect width=\"920\" height=\"670\" fill=\"#fff\"/>\n"
      "<text x=\"20\" y=\"28\" font-size=\"17\" font-weight=\"600\">" +
      plot::EscapeMarkup(heading) +
      "</text>\n<text x=\"20\" y=\"50\" font-size=\"12\" fill=\"#555\">" +
      plot::EscapeMarkup(second) + "</text>\n";
  for (std::size_t i = 0; i < panels.size(); ++i) {
    svg += fmt::format("<g transform=\"translate({} {})\">\n", i % 2 == 0 ? 5 : 465,
                       i < 2 ? 62 : 366) +
           panels[i] + "</g>\n";
  }
  return svg + "</svg>\n";
}

}  // namespace torquer::tools
