#include "host/recorder/panel_plot.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>

#include "host/plot/table.h"
#include "host/recorder/svg_text.h"

namespace torquer {
namespace {

// Sizes in pixels of the drawing, which is scaled to the page.
constexpr double kPanelWidth = 960;
constexpr double kLeft = 66;
constexpr double kRight = kPanelWidth - 16;
constexpr double kTitleHeight = 28;
constexpr double kGap = 8;
constexpr double kCurvesHeight = 84;
constexpr double kBarHeight = 13;
constexpr double kBarDistance = 20;
constexpr double kAxisHeight = 38;
// Bounds the loop even if values are so large that adding a step does not change them.
constexpr int kMostTicks = 40;

constexpr const char* kInk = "#1a2430";
constexpr const char* kFaint = "#566270";
constexpr const char* kGrid = "#dfe4ea";
constexpr const char* kDots = "stroke=\"#9aa4ae\" stroke-width=\"4\" stroke-linecap=\"round\"";
constexpr const char* kLimitColor = "#a3123a";

// Color and dashes of a curve. The colors are those of Okabe and Ito, "Color Universal Design"
// (2008), without those too pale for lines on white.
struct Look {
  const char* color;
  const char* dashes;
};
constexpr std::array<Look, 4> kLooks = {
    {{"#0072b2", "none"}, {"#d55e00", "7 3"}, {"#00785a", "2 3"}, {"#a64d85", "9 3 2 3"}}};

const Look& LookOf(std::size_t index) { return kLooks[index % kLooks.size()]; }

// Linear scale of one axis, from values to pixels.
struct Scale {
  double low, high;
  double low_px, high_px;
  double Pixel(double value) const {
    return low_px + (value - low) / (high - low) * (high_px - low_px);
  }
};

// Widens an empty range.
void Widen(double& low, double& high) {
  if (high > low) return;
  const double half = std::max(0.5, 0.01 * std::abs(low));
  low -= half;
  high += half;
}

Scale ScaleOf(const PlotPanel& panel, double top_px, double bottom_px) {
  double low = std::numeric_limits<double>::infinity();
  double high = -low;
  for (const PlotCurve& curve : panel.curves) {
    for (const SeriesPoint& point : curve.points) {
      low = std::min(low, point.value);
      high = std::max(high, point.value);
    }
  }
  if (!(low <= high)) low = high = 0;
  if (panel.from_zero) low = std::min(low, 0.0);
  // A limit far above all values would flatten the curves. It is then off the scale, which its
  // label notes.
  constexpr double kFar = 4;
  if (panel.limit && panel.limit->value <= kFar * high) high = std::max(high, panel.limit->value);
  Widen(low, high);
  const double room = 0.07 * (high - low);
  return {panel.from_zero && low >= 0 ? low : low - room, high + room, bottom_px, top_px};
}

// Round values within the scale, about `wanted` of them.
std::vector<double> Ticks(const Scale& scale, double wanted, bool whole) {
  double step = RoundBelow((scale.high - scale.low) / wanted);
  if (whole) step = std::max(step, 1.0);
  const double first = std::ceil(scale.low / step);
  std::vector<double> ticks;
  for (int k = 0; (first + k) * step <= scale.high && k < kMostTicks; ++k) {
    ticks.push_back((first + k) * step + 0.0);  // 0 rather than -0
  }
  return ticks;
}

void AppendText(std::string& out, double x, double y, const char* anchor, const char* color,
                std::string_view text, const char* weight = "normal") {
  Append(out,
         "<text x=\"{:.1f}\" y=\"{:.1f}\" text-anchor=\"{}\" fill=\"{}\" "
         "font-weight=\"{}\">{}</text>\n",
         x, y, anchor, color, weight, plot::EscapeMarkup(text));
}

// Approximate width of a text in pixels.
double TextWidth(const std::string& text) { return 7.4 * static_cast<double>(text.size()); }

/// Draws the panels from the top down.
class Drawing {
 public:
  Drawing(const std::vector<PlotPanel>& panels, const PlotAxis& axis)
      : panels_(panels), axis_(axis), x_{axis.begin, axis.end, kLeft, kRight} {
    Widen(x_.low, x_.high);
    if (axis.counts) {
      x_.low -= 0.4;
      x_.high += 0.4;
    }
  }

  std::string Draw(const std::string& name) {
    double y = 0;
    for (const PlotPanel& panel : panels_) y = DrawPanel(panel, y) + kGap;
    DrawAxis(y);
    std::string svg;
    Append(svg,
           "<svg xmlns=\"http://www.w3.org/2000/svg\" viewBox=\"0 0 {:.0f} {:.0f}\" width=\"100%\" "
           "role=\"img\" font-family=\"'DejaVu Sans', Verdana, sans-serif\" font-size=\"13\">\n"
           "<title>{}</title>\n",
           kPanelWidth, y + kAxisHeight, plot::EscapeMarkup(name));
    return svg + out_ + "</svg>\n";
  }

 private:
  double DrawPanel(const PlotPanel& panel, double y) {
    AppendText(out_, 8, y + 20, "start", kInk, panel.title, "bold");
    DrawLegend(panel, y + 20);
    const double top = y + kTitleHeight;
    const double height =
        panel.bars.empty() ? kCurvesHeight : kBarDistance * static_cast<double>(panel.bars.size());
    Append(out_,
           "<rect x=\"{:.1f}\" y=\"{:.1f}\" width=\"{:.1f}\" height=\"{:.1f}\" "
           "fill=\"#fff\" stroke=\"#aab4c0\"/>\n",
           kLeft, top, kRight - kLeft, height);
    for (const double tick : Ticks(x_, 7, axis_.counts)) {
      Append(out_, "<path d=\"M{:.1f} {:.1f}v{:.1f}\" stroke=\"{}\"/>\n", x_.Pixel(tick), top,
             height, kGrid);
    }
    if (panel.bars.empty()) {
      DrawCurves(panel, ScaleOf(panel, top, top + height));
    } else {
      DrawBars(panel, top);
    }
    DrawMark(top, height);
    return top + height;
  }

  void DrawLegend(const PlotPanel& panel, double y) {
    double x = kRight;
    if (panel.limit) {
      x -= TextWidth(panel.limit->label);
      AppendText(out_, x, y, "start", kLimitColor, panel.limit->label);
      x -= 34;
      Append(out_,
             "<path d=\"M{:.1f} {:.1f}h26\" stroke=\"{}\" stroke-width=\"1.8\" "
             "stroke-dasharray=\"10 3\"/>\n",
             x, y - 4, kLimitColor);
      x -= 16;
    }
    if (!panel.uncounted.empty()) {
      x -= TextWidth(panel.uncounted_label);
      AppendText(out_, x, y, "start", kFaint, panel.uncounted_label);
      x -= 18;
      Append(out_, "<path d=\"M{:.1f} {:.1f}h0\" {}/>\n", x + 8, y - 4, kDots);
      x -= 16;
    }
    for (std::size_t k = panel.curves.size(); k-- > 0;) {
      const std::string& label = panel.curves[k].label;
      if (label.empty()) continue;
      x -= TextWidth(label);
      AppendText(out_, x, y, "start", kInk, label);
      x -= 34;
      Append(out_,
             "<path d=\"M{:.1f} {:.1f}h26\" stroke=\"{}\" stroke-width=\"2\" "
             "stroke-dasharray=\"{}\"/>\n",
             x, y - 4, LookOf(k).color, LookOf(k).dashes);
      x -= 16;
    }
  }

  void DrawCurves(const PlotPanel& panel, const Scale& scale) {
    for (const double tick : Ticks(scale, 2, false)) {
      const double y = scale.Pixel(tick);
      Append(out_, "<path d=\"M{:.1f} {:.1f}H{:.1f}\" stroke=\"{}\"/>\n", kLeft, y, kRight, kGrid);
      AppendText(out_, kLeft - 7, y + 4, "end", kFaint, fmt::format("{:.6g}", tick));
    }
    DrawUncounted(panel.uncounted, scale);
    for (std::size_t k = 0; k < panel.curves.size(); ++k) {
      DrawCurve(panel.curves[k].points, LookOf(k), scale);
    }
    if (!panel.limit || panel.limit->value > scale.high) return;
    Append(out_,
           "<path d=\"M{:.1f} {:.1f}H{:.1f}\" stroke=\"{}\" stroke-width=\"1.8\" "
           "stroke-dasharray=\"10 3\"/>\n",
           kLeft, scale.Pixel(panel.limit->value), kRight, kLimitColor);
  }

  void DrawUncounted(const std::vector<SeriesPoint>& points, const Scale& scale) {
    if (points.empty()) return;
    std::string path;
    for (const SeriesPoint& point : points) {
      const double shown = std::clamp(point.value, scale.low, scale.high);
      Append(path, "M{:.1f} {:.1f}h0", x_.Pixel(point.time_s), scale.Pixel(shown));
    }
    Append(out_, "<path d=\"{}\" {}/>\n", path, kDots);
  }

  void DrawCurve(const std::vector<SeriesPoint>& points, const Look& look, const Scale& scale) {
    std::string path;
    std::string marks;
    for (const SeriesPoint& point : points) {
      const double x = x_.Pixel(point.time_s);
      const double y = scale.Pixel(point.value);
      Append(path, "{}{:.1f} {:.1f}", path.empty() ? "M" : "L", x, y);
      if (axis_.counts) {
        Append(marks, "<circle cx=\"{:.1f}\" cy=\"{:.1f}\" r=\"4\" fill=\"{}\"/>\n", x, y,
               look.color);
      }
    }
    if (path.empty()) return;
    Append(out_,
           "<path d=\"{}\" fill=\"none\" stroke=\"{}\" stroke-width=\"1.6\" "
           "stroke-dasharray=\"{}\" stroke-linejoin=\"round\"/>\n{}",
           path, look.color, look.dashes, marks);
  }

  void DrawBars(const PlotPanel& panel, double top) {
    // A short pulse stays visible in a session of any length.
    constexpr double kLeastWidth = 1.2;
    for (std::size_t k = 0; k < panel.bars.size(); ++k) {
      const double y = top + kBarDistance * static_cast<double>(k);
      AppendText(out_, kLeft - 7, y + 14, "end", kInk, panel.bars[k].label);
      for (const Span& span : panel.bars[k].spans) {
        const double x = x_.Pixel(span.begin_s);
        Append(out_,
               "<rect x=\"{:.1f}\" y=\"{:.1f}\" width=\"{:.1f}\" height=\"{:.1f}\" "
               "fill=\"{}\"/>\n",
               x, y + 0.5 * (kBarDistance - kBarHeight),
               std::max(x_.Pixel(span.end_s) - x, kLeastWidth), kBarHeight, LookOf(k).color);
      }
    }
  }

  void DrawMark(double top, double height) {
    if (!axis_.mark || *axis_.mark < x_.low || *axis_.mark > x_.high) return;
    Append(out_,
           "<path d=\"M{:.1f} {:.1f}v{:.1f}\" stroke=\"{}\" stroke-width=\"1.6\" "
           "stroke-dasharray=\"4 3\"/>\n",
           x_.Pixel(*axis_.mark), top, height, kInk);
  }

  void DrawAxis(double y) {
    for (const double tick : Ticks(x_, 7, axis_.counts)) {
      AppendText(out_, x_.Pixel(tick), y + 10, "middle", kFaint, fmt::format("{:.6g}", tick));
    }
    AppendText(out_, 0.5 * (kLeft + kRight), y + 31, "middle", kInk, axis_.label);
    if (axis_.mark && *axis_.mark >= x_.low && *axis_.mark <= x_.high) {
      AppendText(out_, kRight, y + 31, "end", kInk, axis_.mark_label);
    }
  }

  const std::vector<PlotPanel>& panels_;
  const PlotAxis& axis_;
  Scale x_;
  std::string out_;
};

}  // namespace

std::string DrawPanels(const std::string& name, const std::vector<PlotPanel>& panels,
                       const PlotAxis& axis) {
  return Drawing(panels, axis).Draw(name);
}

}  // namespace torquer
