// Plots as SVG: lines, points, bars and areas over linear or logarithmic axes.
#pragma once

#include <optional>
#include <string>
#include <utility>
#include <vector>

namespace torquer::plot {

struct Axis {
  std::string label;  ///< with its unit
  bool logarithmic = false;
  /// Ends of the axis; without them, the range of the data. Positive where logarithmic.
  std::optional<std::pair<double, double>> range = {};
  bool is_list = false;  ///< its numbers only keep places apart: none is drawn
};

enum class Mark { kLine, kDashed, kPoints, kLineAndPoints, kBars, kArea };

struct Series {
  std::string label;  ///< in the legend; "" keeps it out
  /// kArea: closed outlines, filled; a point that is not finite ends one and begins another.
  Mark mark = Mark::kLine;
  std::vector<double> x;
  std::vector<double> y;  ///< as many as x
  /// One a point, or none: shown when the pointer rests on it.
  std::vector<std::string> notes = {};
  /// Index of the color; negative: the series' place in the plot.
  int color = -1;
};

/// A place that the plot points out, with its name beside it.
struct Callout {
  double x = 0;
  double y = 0;
  std::string label;
};

struct Plot {
  std::string title;
  Axis x;
  Axis y;
  std::vector<Series> series;  ///< the first is drawn first, so the last lies on top
  std::vector<Callout> callouts = {};
  bool equal_scales = false;  ///< a unit is as long on either axis
  int width = 760;            ///< pixels
  int height = 420;
};

/// The plot as one <svg> element that needs no other file. Points that an axis cannot show are left
/// out, and break a line. Such points are not finite, or not positive on a logarithmic axis.
std::string DrawPlot(const Plot& plot);

}  // namespace torquer::plot
