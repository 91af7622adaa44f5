#include "host/plot/svg_plot.h"

#include <algorithm>
#include <array>
#include <cassert>
#include <cmath>
#include <cstdarg>
#include <cstdio>
#include <limits>

#include "host/plot/table.h"

namespace torquer::plot {
namespace {

// Distinguished by eyes of every kind of color vision, with the marker's shape as second sign.
constexpr std::array kColors = {"#1f5fd0", "#d1432f", "#0f8a5f", "#b7791f",
                                "#7546c4", "#0e8fa8", "#b8327f", "#586174"};
constexpr const char* kInk = "#1c2430";
constexpr const char* kFaint = "#5d6877";
constexpr const char* kGrid = "#e3e7ee";

__attribute__((format(printf, 1, 2))) std::string Print(const char* format, ...) {
  std::va_list arguments;
  va_start(arguments, format);
  char text[512];
  std::vsnprintf(text, sizeof text, format, arguments);
  va_end(arguments);
  return text;
}

struct Tick {
  double value;
  std::string label;
};

// From data to pixels along one axis.
struct Scale {
  bool logarithmic = false;
  double low = 0, high = 1;       // ends of the data, as logarithms where logarithmic
  double from_px = 0, to_px = 1;  // where they lie
  bool Shows(double v) const { return std::isfinite(v) && (!logarithmic || v > 0); }
  double Place(double v) const { return logarithmic ? std::log10(v) : v; }
  double Pixel(double v) const {
    return from_px + (Place(v) - low) / (high - low) * (to_px - from_px);
  }
};

Scale FitScale(const Axis& axis, const Plot& plot, bool is_x) {
  Scale scale;
  scale.logarithmic = axis.logarithmic;
  if (axis.range) {
    scale.low = scale.Place(axis.range->first);
    scale.high = scale.Place(axis.range->second);
    return scale;
  }
  double low = std::numeric_limits<double>::infinity();
  double high = -low;
  for (const Series& s : plot.series) {
    for (std::size_t k = 0; k < s.x.size(); ++k) {
      const double v = is_x ? s.x[k] : s.y[k];
      if (!scale.Shows(v)) continue;
      low = std::min(low, scale.Place(v));
      high = std::max(high, scale.Place(v));
      if (s.mark == Mark::kBars && !is_x && !axis.logarithmic) low = std::min(low, 0.0);
    }
  }
  if (!(low <= high)) {
    low = 0;
    high = 1;
  }
  if (high - low < 1e-9 * std::max(1.0, std::abs(high))) {
    low -= 0.5;
    high += 0.5;
  }
  const double room = 0.05 * (high - low);
  // Room beside the data, but not below a natural zero.
  scale.low = low >= 0 && low < 0.25 * high && !axis.logarithmic ? 0 : low - room;
  scale.high = high + room;
  return scale;
}

std::string Superscript(int number) {
  static const std::array kDigits = {"⁰", "¹", "²", "³", "⁴", "⁵", "⁶", "⁷", "⁸", "⁹"};
  std::string text = number < 0 ? "⁻" : "";
  for (const char c : std::to_string(std::abs(number))) {
    text += kDigits[static_cast<std::size_t>(c - '0')];
  }
  return text;
}

std::vector<Tick> Ticks(const Scale& scale, double pixels_per_tick) {
  std::vector<Tick> ticks;
  const double span = scale.high - scale.low;
  const double wanted = std::max(2.0, std::abs(scale.to_px - scale.from_px) / pixels_per_tick);
  if (scale.logarithmic && span > 0.9) {
    const int step = std::max(1, static_cast<int>(std::ceil(span / wanted)));
    const bool between = span < 2.5;
    for (int e = static_cast<int>(std::floor(scale.low)); e <= scale.high + 1; e += 1) {
      if (e % step != 0) continue;
      for (const int digit : {1, 2, 5}) {
        const double v = digit * std::pow(10.0, e);
        const double at = std::log10(v);
        if ((digit > 1 && !between) || at < scale.low - 1e-9 || at > scale.high + 1e-9) continue;
        ticks.push_back({v, e >= -3 && e <= 3
                                ? Number(v, 3)
                                : (digit > 1 ? Print("%d·", digit) : "") + "10" + Superscript(e)});
      }
    }
    return ticks;
  }
  const double low = scale.logarithmic ? std::pow(10, scale.low) : scale.low;
  const double high = scale.logarithmic ? std::pow(10, scale.high) : scale.high;
  const double raw = (high - low) / wanted;
  const double decade = std::pow(10.0, std::floor(std::log10(raw)));
  double step = 10 * decade;
  for (const double s : {1.0, 2.0, 2.5, 5.0}) {
    if (s * decade >= raw) {
      step = s * decade;
      break;
    }
  }
  for (double k = std::ceil(low / step - 1e-9); k * step <= high + 1e-9 * step; k += 1) {
    const double v = k * step;
    ticks.push_back({v, Number(std::abs(v) < 1e-9 * step ? 0 : v, 6)});
  }
  return ticks;
}

std::string Shape(int shape, double x, double y, const char* color, const std::string& note) {
  const std::string look =
      Print("fill=\"%s\" fill-opacity=\"0.8\" stroke=\"#fff\" stroke-width=\"0.8\"", color);
  const std::string title = note.empty() ? "" : "<title>" + EscapeMarkup(note) + "</title>";
  switch (shape % 4) {
    case 0:
      return Print("<circle cx=\"%.2f\" cy=\"%.2f\" r=\"4\" ", x, y) + look + ">" + title +
             "</circle>\n";
    case 1:
      return Print("<rect x=\"%.2f\" y=\"%.2f\" width=\"7\" height=\"7\" ", x - 3.5, y - 3.5) +
             look + ">" + title + "</rect>\n";
    case 2:
      return Print("<path d=\"M%.2f %.2fl4.6 8h-9.2z\" ", x, y - 5) + look + ">" + title +
             "</path>\n";
    default:
      return Print("<path d=\"M%.2f %.2fl4.8 4.8l-4.8 4.8l-4.8 -4.8z\" ", x, y - 4.8) + look + ">" +
             title + "</path>\n";
  }
}

// Draws one plot into a growing text.
class Drawing {
 public:
  explicit Drawing(const Plot& plot) : plot_(plot) {}

  std::string Draw() {
    PlaceLegend();
    left_ = 74;
    right_ = plot_.width - 22;
    top_ = (plot_.title.empty() ? 14 : 40) + legend_height_;
    bottom_ = plot_.height - 54;
    x_ = FitScale(plot_.x, plot_, true);
    y_ = FitScale(plot_.y, plot_, false);
    x_.from_px = left_;
    x_.to_px = right_;
    y_.from_px = bottom_;
    y_.to_px = top_;
    if (plot_.equal_scales) Equalize();

    svg_ = Print(
        "<svg xmlns=\"http://www.w3.org/2000/svg\" viewBox=\"0 0 %d %d\" width=\"%d\" "
        "height=\"%d\" "
        "role=\"img\" font-family=\"Inter, 'Segoe UI', 'DejaVu Sans', sans-serif\" "
        "font-size=\"12\">\n"
        "<rect width=\"%d\" height=\"%d\" rx=\"6\" fill=\"#fff\"/>\n",
        plot_.width, plot_.height, plot_.width, plot_.height, plot_.width, plot_.height);
    svg_ += "<title>" + EscapeMarkup(plot_.title) + "</title>\n";
    if (!plot_.title.empty()) {
      Text(left_, 25, "start", kInk, plot_.title, "font-size=\"15\" font-weight=\"600\"");
    }
    DrawAxes();
    svg_ += legend_;
    // A clip path's name must differ from those of other plots in one page.
    const std::size_t name = std::hash<std::string>{}(svg_ + plot_.title) % 1000000007u;
    svg_ += Print(
        "<clipPath id=\"c%zu\"><rect x=\"%.1f\" y=\"%.1f\" width=\"%.1f\" "
        "height=\"%.1f\"/></clipPath>\n",
        name, left_ - 6, top_ - 6, right_ - left_ + 12, bottom_ - top_ + 12);
    svg_ += Print("<g clip-path=\"url(#c%zu)\">\n", name);
    for (std::size_t k = 0; k < plot_.series.size(); ++k) DrawSeries(plot_.series[k], ColorOf(k));
    svg_ += "</g>\n";
    for (const Callout& callout : plot_.callouts) DrawCallout(callout);
    return svg_ + "</svg>\n";
  }

 private:
  int ColorOf(std::size_t k) const {
    const int own = plot_.series[k].color;
    return own >= 0 ? own : static_cast<int>(k);
  }
  static const char* Color(int index) {
    return kColors[static_cast<std::size_t>(index) % kColors.size()];
  }

  void Text(double x, double y, const char* anchor, const char* color, const std::string& text,
            const std::string& extra = "") {
    svg_ +=
        Print("<text x=\"%.1f\" y=\"%.1f\" text-anchor=\"%s\" fill=\"%s\" ", x, y, anchor, color) +
        extra + ">" + EscapeMarkup(text) + "</text>\n";
  }

  // The legend is a paragraph between title and plot, so that it never hides data.
  void PlaceLegend() {
    constexpr double kLine = 20;
    double x = 74;
    double y = plot_.title.empty() ? 20 : 46;
    for (std::size_t k = 0; k < plot_.series.size(); ++k) {
      const Series& s = plot_.series[k];
      if (s.label.empty()) continue;
      const double width = 42 + 6.9 * static_cast<double>(s.label.size());
      if (x > 74 && x + width > plot_.width - 10) {
        x = 74;
        y += kLine;
      }
      const char* color = Color(ColorOf(k));
      const bool points = s.mark == Mark::kPoints || s.mark == Mark::kLineAndPoints;
      if (s.mark == Mark::kBars || s.mark == Mark::kArea) {
        legend_ += Print(
            "<rect x=\"%.1f\" y=\"%.1f\" width=\"18\" height=\"9\" fill=\"%s\" "
            "fill-opacity=\"%s\"/>\n",
            x, y - 4.5, color, s.mark == Mark::kArea ? "0.16" : "0.75");
      } else if (s.mark != Mark::kPoints) {
        legend_ += Print("<path d=\"M%.1f %.1fh20\" stroke=\"%s\" stroke-width=\"2.2\"%s/>\n", x, y,
                         color, s.mark == Mark::kDashed ? " stroke-dasharray=\"5 4\"" : "");
      }
      if (points) legend_ += Shape(ColorOf(k), x + 10, y, color, "");
      legend_ += Print("<text x=\"%.1f\" y=\"%.1f\" fill=\"%s\">", x + 26, y + 4, kInk) +
                 EscapeMarkup(s.label) + "</text>\n";
      x += width;
      legend_height_ = y - (plot_.title.empty() ? 20 : 46) + kLine + 4;
    }
  }

  void Equalize() {
    const double x_unit = (x_.to_px - x_.from_px) / (x_.high - x_.low);
    const double y_unit = (y_.from_px - y_.to_px) / (y_.high - y_.low);
    Scale& wide = x_unit > y_unit ? x_ : y_;
    const double grow = std::max(x_unit, y_unit) / std::min(x_unit, y_unit);
    const double middle = (wide.low + wide.high) / 2;
    const double half = (wide.high - wide.low) / 2 * grow;
    wide.low = middle - half;
    wide.high = middle + half;
  }

  void DrawAxes() {
    for (const Tick& tick : Ticks(x_, 80)) {
      const double x = x_.Pixel(tick.value);
      svg_ += Print("<path d=\"M%.1f %.1fV%.1f\" stroke=\"%s\"/>\n", x, top_, bottom_, kGrid);
      Text(x, bottom_ + 18, "middle", kFaint, tick.label);
    }
    for (const Tick& tick : plot_.y.is_list ? std::vector<Tick>() : Ticks(y_, 44)) {
      const double y = y_.Pixel(tick.value);
      svg_ += Print("<path d=\"M%.1f %.1fH%.1f\" stroke=\"%s\"/>\n", left_, y, right_, kGrid);
      Text(left_ - 8, y + 4, "end", kFaint, tick.label);
    }
    svg_ += Print("<path d=\"M%.1f %.1fV%.1fH%.1f\" fill=\"none\" stroke=\"#9aa4b2\"/>\n", left_,
                  top_, bottom_, right_);
    Text((left_ + right_) / 2, plot_.height - 14, "middle", kInk, plot_.x.label);
    const double middle = (top_ + bottom_) / 2;
    Text(18, middle, "middle", kInk, plot_.y.label,
         Print("transform=\"rotate(-90 18 %.1f)\"", middle));
  }

  void DrawSeries(const Series& s, int color_index) {
    assert(s.x.size() == s.y.size() && (s.notes.empty() || s.notes.size() == s.x.size()));
    const char* color = Color(color_index);
    if (s.mark == Mark::kBars) return DrawBars(s, color);
    if (s.mark != Mark::kPoints) {
      std::string path;
      bool down = false;
      for (std::size_t k = 0; k < s.x.size(); ++k) {
        if (!x_.Shows(s.x[k]) || !y_.Shows(s.y[k])) {
          down = false;
          continue;
        }
        path += Print("%s%.2f %.2f", down ? "L" : "M", x_.Pixel(s.x[k]), y_.Pixel(s.y[k]));
        down = true;
      }
      if (s.mark == Mark::kArea) {
        svg_ += "<path d=\"" + path + Print("\" fill=\"%s\" fill-opacity=\"0.16\"/>\n", color);
        return;
      }
      svg_ += "<path d=\"" + path +
              Print(
                  "\" fill=\"none\" stroke-linejoin=\"round\" stroke-linecap=\"round\" "
                  "stroke=\"%s\" stroke-width=\"2.00\"%s/>\n",
                  color, s.mark == Mark::kDashed ? " stroke-dasharray=\"6 4\"" : "");
    }
    if (s.mark != Mark::kPoints && s.mark != Mark::kLineAndPoints) return;
    for (std::size_t k = 0; k < s.x.size(); ++k) {
      if (!x_.Shows(s.x[k]) || !y_.Shows(s.y[k])) continue;
      svg_ += Shape(color_index, x_.Pixel(s.x[k]), y_.Pixel(s.y[k]), color,
                    s.notes.empty() ? "" : s.notes[k]);
    }
  }

  void DrawBars(const Series& s, const char* color) {
    const double n = static_cast<double>(std::max<std::size_t>(1, s.x.size()));
    const double width = std::max(1.0, 0.8 * (right_ - left_) / n);
    for (std::size_t k = 0; k < s.x.size(); ++k) {
      if (!x_.Shows(s.x[k]) || !y_.Shows(s.y[k])) continue;
      const double y = std::min(y_.Pixel(s.y[k]), bottom_);
      svg_ += Print(
          "<rect x=\"%.2f\" y=\"%.2f\" width=\"%.2f\" height=\"%.2f\" fill=\"%s\" "
          "fill-opacity=\"0.75\">",
          x_.Pixel(s.x[k]) - width / 2, y, width, bottom_ - y, color);
      if (!s.notes.empty()) svg_ += "<title>" + EscapeMarkup(s.notes[k]) + "</title>";
      svg_ += "</rect>\n";
    }
  }

  void DrawCallout(const Callout& callout) {
    if (!x_.Shows(callout.x) || !y_.Shows(callout.y)) return;
    const double x = x_.Pixel(callout.x);
    const double y = y_.Pixel(callout.y);
    svg_ += Print(
        "<circle cx=\"%.1f\" cy=\"%.1f\" r=\"8\" fill=\"none\" stroke=\"%s\" "
        "stroke-width=\"2\"/>\n",
        x, y, kInk);
    const bool to_left = x > (left_ + right_) / 2;
    // Beside the marker in a list, where a label above it would cover the marker of the row above.
    const double baseline = plot_.y.is_list ? y + 4 : y - 8;
    Text(to_left ? x - 13 : x + 13, baseline, to_left ? "end" : "start", kInk, callout.label,
         "font-weight=\"600\" stroke=\"#fff\" stroke-width=\"3\" paint-order=\"stroke\"");
  }

  const Plot& plot_;
  std::string svg_;
  std::string legend_;
  double legend_height_ = 0;
  double left_ = 0, right_ = 0, top_ = 0, bottom_ = 0;
  Scale x_;
  Scale y_;
};

}  // namespace

std::string DrawPlot(const Plot& plot) { return Drawing(plot).Draw(); }

}  // namespace torquer::plot
