// Plots above each other over one axis, as SVG: the time line of a session, the learning curve.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "host/recorder/session_series.h"

namespace torquer {

/// A curve. Each has its own color and dashes, so that they can be distinguished in print and
/// by eyes of every kind of color vision.
struct PlotCurve {
  std::string label;  ///< "" where the panel has only one
  std::vector<SeriesPoint> points;
};

/// A bar where something was on.
struct PlotBar {
  std::string label;
  std::vector<Span> spans;
};

/// A value that should not be passed, in the unit of the panel.
struct PlotLimit {
  double value = 0;
  std::string label;  ///< with its value and unit
};

/// One of the plots: curves over an axis of values, or bars.
struct PlotPanel {
  std::string title;  ///< with the unit of its values
  std::vector<PlotCurve> curves = {};
  std::vector<PlotBar> bars = {};
  std::optional<PlotLimit> limit = {};
  bool from_zero = false;  ///< the axis begins at 0
};

/// The axis that all panels share.
struct PlotAxis {
  std::string label;  ///< with its unit
  double begin = 0;
  double end = 1;       ///< where it is not above `begin`, the axis shows some room around it
  bool counts = false;  ///< single things, which have whole numbers: points are marked
  /// Pointed out in all panels: where, and what.
  std::optional<double> mark = {};
  std::string mark_label = {};
};

/// The panels as one <svg> element, as wide as what it stands in. It needs nothing else, and is
/// styled by attributes alone. Text is escaped. `name`: what it shows, for those who cannot see it.
std::string DrawPanels(const std::string& name, const std::vector<PlotPanel>& panels,
                       const PlotAxis& axis);

}  // namespace torquer
