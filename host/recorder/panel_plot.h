// Stacked plots over one shared axis, as SVG: the time line of a session, the learning curve.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "host/recorder/session_series.h"

namespace torquer {

/// Curve. Each has its own color and dashes, to be distinguishable in print and for every kind of
/// color vision.
struct PlotCurve {
  std::string label;  ///< "" where the panel has only one
  std::vector<SeriesPoint> points;
};

/// Bar that is drawn while something was on.
struct PlotBar {
  std::string label;
  std::vector<Span> spans;
};

/// Limit that values should not pass, in the unit of the panel.
struct PlotLimit {
  double value = 0;
  std::string label;  ///< with its value and unit
};

/// One plot: curves over an axis of values, or bars.
struct PlotPanel {
  std::string title;  ///< with the unit of its values
  std::vector<PlotCurve> curves = {};
  std::vector<PlotBar> bars = {};
  std::optional<PlotLimit> limit = {};
  /// Points that do not count: drawn as gray dots, without influence on the scale. Beyond the scale
  /// they lie on its edge.
  std::vector<SeriesPoint> uncounted = {};
  std::string uncounted_label = {};
  bool from_zero = false;  ///< the axis begins at 0
};

/// Axis that all panels share.
struct PlotAxis {
  std::string label;  ///< with its unit
  double begin = 0;
  double end = 1;       ///< if not above `begin`, the axis is widened around it
  bool counts = false;  ///< values are counts, so ticks are whole numbers and points are marked
  /// Position of a mark in all panels, and its label.
  std::optional<double> mark = {};
  std::string mark_label = {};
};

/// Draws the panels as one self-contained <svg> element, as wide as its parent element. It is
/// styled by attributes alone. Text is escaped. `name`: description for screen readers.
std::string DrawPanels(const std::string& name, const std::vector<PlotPanel>& panels,
                       const PlotAxis& axis);

}  // namespace torquer
