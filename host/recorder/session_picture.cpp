#include "host/recorder/session_picture.h"

#include <fmt/format.h>

#include <Eigen/Geometry>
#include <algorithm>
#include <array>
#include <cmath>
#include <utility>

#include "host/plot/table.h"
#include "host/recorder/svg_text.h"

namespace torquer {
namespace {

using Box = Eigen::AlignedBox2d;

// Sizes in pixels of the whole picture and of its two panels.
constexpr double kWidth = 1200;
constexpr double kHeight = 1000;
constexpr double kMargin = 36;
constexpr double kTop = 118;
constexpr double kOverviewWidth = 440;
constexpr double kCloseUpHeight = 610;

constexpr int kShades = 32;
constexpr std::size_t kMostTriangles = 14000;
// Length of the wire, from its tip, that the close-up shows.
constexpr double kCloseUpLengthMm = 90;
// Length of the wire, from its tip, that is drawn in another color.
constexpr double kTipLengthMm = 10;
// Colors of the instruments, the innermost first. Each is drawn kWider pixels wider than the one
// inside it.
constexpr std::array<const char*, 4> kInstrumentColors = {"#fff3c4", "#7be0a8", "#8fb2ff",
                                                          "#d9a3ff"};
constexpr double kWider = 3;
// Width of the tip's path, pixels.
constexpr double kWayWidth = 1.1;

struct Color {
  double red, green, blue;
};

// Piecewise linear interpolation over the three colors, for `position` 0 .. 1.
Color Blend(const std::array<Color, 3>& ramp, double position) {
  const std::size_t from = position < 0.5 ? 0 : 1;
  const double part = 2 * position - static_cast<double>(from);
  const Color& a = ramp[from];
  const Color& b = ramp[from + 1];
  return {a.red + part * (b.red - a.red), a.green + part * (b.green - a.green),
          a.blue + part * (b.blue - a.blue)};
}

constexpr std::array<Color, 3> kFarRamp = {{{44, 14, 24}, {118, 34, 44}, {186, 78, 74}}};
constexpr std::array<Color, 3> kNearRamp = {{{96, 26, 36}, {222, 92, 84}, {255, 222, 206}}};

void AppendShadeClasses(std::string& out, char name, const std::array<Color, 3>& ramp) {
  for (int shade = 0; shade < kShades; ++shade) {
    const Color color = Blend(ramp, shade / (kShades - 1.0));
    Append(out, ".{}{}{{fill:#{:02x}{:02x}{:02x};stroke:#{:02x}{:02x}{:02x}}}", name, shade,
           static_cast<int>(color.red), static_cast<int>(color.green), static_cast<int>(color.blue),
           static_cast<int>(color.red), static_cast<int>(color.green),
           static_cast<int>(color.blue));
  }
}

/// Panel: maps vessel millimeters (x right, y up) to pixels of the picture.
struct Panel {
  Box pixels;
  Eigen::Vector2d center_mm;
  double pixels_per_mm;

  Panel(const Box& pixels_in, const Box& shown_mm)
      : pixels(pixels_in),
        center_mm(shown_mm.center()),
        pixels_per_mm((pixels_in.sizes().array() / shown_mm.sizes().array()).minCoeff()) {}

  Box ShownMm() const {
    const Eigen::Vector2d half = 0.5 * pixels.sizes() / pixels_per_mm;
    return {center_mm - half, center_mm + half};
  }
  // SVG matrix for the coordinates in the file: 0.01 mm, y down.
  std::string Transform() const {
    std::string text;
    const double scale = pixels_per_mm * 0.01;
    Append(text, "matrix({:.6f} 0 0 {:.6f} {:.3f} {:.3f})", scale, scale,
           pixels.center().x() - center_mm.x() * pixels_per_mm,
           pixels.center().y() + center_mm.y() * pixels_per_mm);
    return text;
  }
};

Eigen::Vector2i Hundredths(const Eigen::Vector2d& point_mm) {
  return {static_cast<int>(std::lround(point_mm.x() * 100)),
          static_cast<int>(std::lround(-point_mm.y() * 100))};
}

// Writes one path for each run of triangles of one shade; one path for each triangle would be
// larger.
void AppendWall(std::string& out, const std::vector<ShadedTriangle>& wall, char name) {
  int open_shade = -1;
  for (const ShadedTriangle& triangle : wall) {
    const int shade = static_cast<int>(std::lround(triangle.light * (kShades - 1)));
    if (shade != open_shade) {
      if (open_shade >= 0) out += "\"/>\n";
      Append(out, "<path class=\"{}{}\" d=\"", name, shade);
      open_shade = shade;
    }
    const Eigen::Vector2i a = Hundredths(triangle.corners_mm[0]);
    const Eigen::Vector2i ab = Hundredths(triangle.corners_mm[1]) - a;
    const Eigen::Vector2i bc = Hundredths(triangle.corners_mm[2]) - a - ab;
    Append(out, "M{} {}l{} {} {} {}z", a.x(), a.y(), ab.x(), ab.y(), bc.x(), bc.y());
  }
  if (open_shade >= 0) out += "\"/>\n";
}

std::string Polyline(const std::vector<Eigen::Vector2d>& points_mm) {
  std::string path;
  for (std::size_t i = 0; i < points_mm.size(); ++i) {
    const Eigen::Vector2i point = Hundredths(points_mm[i]);
    Append(path, "{}{} {}", i == 0 ? "M" : i == 1 ? "L" : " ", point.x(), point.y());
  }
  return path;
}

/// Projected wire, mm.
struct SeenWire {
  std::vector<Eigen::Vector2d> nodes;
  std::vector<std::vector<Eigen::Vector2d>> parts;  // part of each instrument, the innermost first
  std::vector<Eigen::Vector2d> way;                 // path of the tip
  std::size_t tip_start = 0;                        // first node of the tip
  std::size_t close_up_start = 0;                   // first node that the close-up shows
};

// First `length_mm` of a polyline; the end may lie between two of its points.
std::vector<Eigen::Vector3d> Beginning(const std::vector<Eigen::Vector3d>& points,
                                       double length_mm) {
  std::vector<Eigen::Vector3d> out = {points.front()};
  for (std::size_t i = 1; i < points.size() && length_mm > 0; ++i) {
    const Eigen::Vector3d way = points[i] - points[i - 1];
    const double part = std::min(1.0, length_mm / std::max(way.norm(), 1e-9));
    out.emplace_back(points[i - 1] + part * way);
    length_mm -= way.norm();
  }
  return out;
}

SeenWire See(const PictureWire& wire, const PatientAxes& axes) {
  SeenWire seen;
  for (const Eigen::Vector3d& node : wire.nodes_mm) {
    seen.nodes.emplace_back(SeenFromTheFront(axes, node).head<2>());
  }
  for (const PictureInstrument& instrument : wire.instruments) {
    std::vector<Eigen::Vector2d>& part = seen.parts.emplace_back();
    for (const Eigen::Vector3d& node : instrument.nodes_mm.empty()
                                           ? Beginning(wire.nodes_mm, instrument.insertion_mm)
                                           : instrument.nodes_mm) {
      part.emplace_back(SeenFromTheFront(axes, node).head<2>());
    }
  }
  if (seen.parts.empty()) seen.parts.push_back(seen.nodes);
  for (const Eigen::Vector3d& point : wire.tip_way_mm) {
    seen.way.emplace_back(SeenFromTheFront(axes, point).head<2>());
  }
  double from_tip = 0;
  for (std::size_t i = wire.nodes_mm.size(); i-- > 0;) {
    if (i + 1 < wire.nodes_mm.size()) {
      from_tip += (wire.nodes_mm[i + 1] - wire.nodes_mm[i]).norm();
    }
    if (from_tip <= kTipLengthMm) seen.tip_start = i;
    if (from_tip <= kCloseUpLengthMm) seen.close_up_start = i;
  }
  return seen;
}

// `weight` is the line's width in pixels.
void AppendWire(std::string& out, const SeenWire& seen, const PictureWire& wire,
                const PatientAxes& axes, const Panel& panel, double weight) {
  const double unit = 100 / panel.pixels_per_mm;  // one pixel in hundredths of a mm
  const std::string tip = Polyline(
      {seen.nodes.begin() + static_cast<std::ptrdiff_t>(seen.tip_start), seen.nodes.end()});
  out += "<g fill=\"none\" stroke-linecap=\"round\" stroke-linejoin=\"round\">\n";
  for (const bool outline : {true, false}) {
    for (std::size_t k = seen.parts.size(); k-- > 0;) {
      const double width = weight + kWider * static_cast<double>(k) + (outline ? 2.4 : 0);
      const std::string color = outline ? "#12060a\" stroke-opacity=\".55"
                                        : kInstrumentColors[k % kInstrumentColors.size()];
      Append(out, "<path d=\"{}\" stroke=\"{}\" stroke-width=\"{:.1f}\"/>\n",
             Polyline(seen.parts[k]), color, width * unit);
    }
  }
  Append(out, "<path d=\"{}\" stroke=\"#38e1ff\" stroke-width=\"{:.1f}\"/>\n", tip,
         (weight + 0.4) * unit);
  if (!seen.way.empty()) {
    Append(out, "<path d=\"{}\" stroke=\"#ffffff\" stroke-width=\"{:.1f}\"/>\n", Polyline(seen.way),
           kWayWidth * unit);
  }
  out += "</g>\n<g fill=\"#ffb000\" stroke=\"#5a2a00\" stroke-opacity=\".7\">\n";
  for (const PictureContact& contact : wire.contacts) {
    const Eigen::Vector2i point = Hundredths(SeenFromTheFront(axes, contact.point_mm).head<2>());
    // A penetration of a tenth of the wire's radius, some 20 um, should look large.
    const double radius =
        weight * (0.42 + 0.5 * std::sqrt(std::min(contact.penetration_um, 40.0) / 40));
    Append(out, "<circle cx=\"{}\" cy=\"{}\" r=\"{:.1f}\" stroke-width=\"{:.1f}\"/>\n", point.x(),
           point.y(), radius * unit, 0.5 * unit);
  }
  const Eigen::Vector2i end = Hundredths(seen.nodes.back());
  Append(out,
         "</g>\n<circle cx=\"{}\" cy=\"{}\" r=\"{:.1f}\" fill=\"#e9fbff\" stroke=\"#38e1ff\" "
         "stroke-width=\"{:.1f}\"/>\n",
         end.x(), end.y(), (0.5 * weight + 1.2) * unit, 1.4 * unit);
}

void AppendPanel(std::string& out, const char* name, const Panel& panel) {
  const Box& box = panel.pixels;
  Append(out,
         "<clipPath id=\"{}\"><rect x=\"{:.1f}\" y=\"{:.1f}\" width=\"{:.1f}\" height=\"{:.1f}\" "
         "rx=\"10\"/></clipPath>\n",
         name, box.min().x(), box.min().y(), box.sizes().x(), box.sizes().y());
  Append(out,
         "<rect x=\"{:.1f}\" y=\"{:.1f}\" width=\"{:.1f}\" height=\"{:.1f}\" rx=\"10\" "
         "fill=\"#111a2b\"/>\n",
         box.min().x(), box.min().y(), box.sizes().x(), box.sizes().y());
}

// The scale bar is at most a quarter of the panel.
void AppendScaleBar(std::string& out, const Panel& panel) {
  const double length_mm = RoundBelow(0.25 * panel.pixels.sizes().x() / panel.pixels_per_mm);
  const double length = length_mm * panel.pixels_per_mm;
  const double x = panel.pixels.max().x() - 20 - length;
  const double y = panel.pixels.max().y() - 18;
  Append(out,
         "<path d=\"M{:.1f} {:.1f}v-5m0 5h{:.1f}v-5\" fill=\"none\" stroke=\"#c9d4e8\" "
         "stroke-width=\"1.6\"/>\n",
         x, y, length);
  Append(out,
         "<text x=\"{:.1f}\" y=\"{:.1f}\" class=\"small\" text-anchor=\"middle\">{:g} mm</text>\n",
         x + 0.5 * length, y - 9, length_mm);
}

void AppendOrientation(std::string& out, const Panel& panel) {
  const Box& box = panel.pixels;
  const auto letter = [&out](double x, double y, char name) {
    Append(out,
           "<text x=\"{:.1f}\" y=\"{:.1f}\" class=\"letter\" text-anchor=\"middle\">{}</text>\n", x,
           y, name);
  };
  letter(box.min().x() + 18, box.center().y() + 6, 'R');
  letter(box.max().x() - 18, box.center().y() + 6, 'L');
  letter(box.center().x(), box.min().y() + 25, 'H');
  letter(box.center().x(), box.max().y() - 14, 'F');
}

// Legend for the colors of several instruments.
void AppendLegend(std::string& out, const PictureWire& wire, const Panel& panel) {
  if (wire.instruments.size() < 2) return;
  const double x = panel.pixels.min().x() + 20;
  for (std::size_t k = 0; k < wire.instruments.size(); ++k) {
    const double y = panel.pixels.min().y() + 26 + 22 * static_cast<double>(k);
    Append(out, "<path d=\"M{:.1f} {:.1f}h26\" stroke=\"{}\" stroke-width=\"{:.1f}\"/>\n", x, y,
           kInstrumentColors[k % kInstrumentColors.size()], 3.4 + kWider * static_cast<double>(k));
    Append(out, "<text x=\"{:.1f}\" y=\"{:.1f}\" class=\"subtitle\">{} {:.1f} mm</text>\n", x + 36,
           y + 5, plot::EscapeMarkup(wire.instruments[k].name), wire.instruments[k].insertion_mm);
  }
  const bool several =
      std::any_of(wire.instruments.begin(), wire.instruments.end(),
                  [](const PictureInstrument& instrument) { return !instrument.nodes_mm.empty(); });
  if (!several) return;
  const double y = panel.pixels.min().y() + 31 + 22 * static_cast<double>(wire.instruments.size());
  Append(out, "<text x=\"{:.1f}\" y=\"{:.1f}\" class=\"subtitle\">contacts of {} alone</text>\n", x,
         y, plot::EscapeMarkup(wire.instruments[0].name));
}

void AppendFigures(std::string& out, const PictureCaption& caption, const Box& box) {
  constexpr std::size_t kColumns = 3;
  const std::size_t rows = (caption.figures.size() + kColumns - 1) / kColumns;
  const double column_width = box.sizes().x() / static_cast<double>(kColumns);
  const double row_height =
      rows > 0 ? std::min(64.0, box.sizes().y() / static_cast<double>(rows)) : 0;
  for (std::size_t i = 0; i < caption.figures.size(); ++i) {
    const std::size_t column = i % kColumns;
    const std::size_t row = i / kColumns;
    const double x = box.min().x() + static_cast<double>(column) * column_width;
    const double y = box.min().y() + static_cast<double>(row) * row_height;
    Append(out, "<text x=\"{:.1f}\" y=\"{:.1f}\" class=\"value\">{}</text>\n", x, y + 22,
           plot::EscapeMarkup(caption.figures[i].second));
    Append(out, "<text x=\"{:.1f}\" y=\"{:.1f}\" class=\"small\">{}</text>\n", x, y + 40,
           plot::EscapeMarkup(caption.figures[i].first));
  }
}

Box Grown(const Box& box, double share, double at_least_mm) {
  const Eigen::Vector2d half =
      (0.5 * (1 + share) * box.sizes()).cwiseMax(0.5 * at_least_mm * Eigen::Vector2d::Ones());
  return {box.center() - half, box.center() + half};
}

}  // namespace

std::string DrawSession(const PictureVessel& vessel, const PatientAxes& axes,
                        const PictureWire& wire, const PictureCaption& caption) {
  const SeenWire seen = See(wire, axes);
  Box whole;
  for (const Eigen::Vector2d& node : seen.nodes) whole.extend(node);
  for (const std::vector<Eigen::Vector2d>& part : seen.parts) {
    for (const Eigen::Vector2d& node : part) whole.extend(node);
  }
  for (const auto& corners : vessel.triangles_mm) {
    for (const Eigen::Vector3d& corner : corners) {
      whole.extend(Eigen::Vector2d(SeenFromTheFront(axes, corner).head<2>()));
    }
  }
  Box distal;
  for (std::size_t i = seen.close_up_start; i < seen.nodes.size(); ++i)
    distal.extend(seen.nodes[i]);

  const double right = kMargin + kOverviewWidth + 24;
  const Panel overview(Box(Eigen::Vector2d(kMargin, kTop),
                           Eigen::Vector2d(kMargin + kOverviewWidth, kHeight - kMargin)),
                       Grown(whole, 0.08, 1));
  const Panel close_up(
      Box(Eigen::Vector2d(right, kTop), Eigen::Vector2d(kWidth - kMargin, kTop + kCloseUpHeight)),
      Grown(distal, 0.35, 30));
  ShadingDetail detail;
  detail.side_mm = whole.sizes().maxCoeff() / 110;
  detail.fine_side_mm = close_up.ShownMm().sizes().maxCoeff() / 60;
  detail.fine_region_mm = close_up.ShownMm();
  detail.most_triangles = kMostTriangles;
  const ShadedVessel shaded = ShadeVessel(vessel, axes, detail);

  std::string out;
  Append(out,
         "<svg xmlns=\"http://www.w3.org/2000/svg\" class=\"session\" viewBox=\"0 0 {:g} {:g}\" "
         "width=\"{:g}\" height=\"{:g}\">\n",
         kWidth, kHeight, kWidth, kHeight);
  // The text style applies to this picture only, also inside a page. Shade classes have no .session
  // prefix, because content repeated by <use> is not inside .session.
  out +=
      "<style>.session text{font-family:'DejaVu Sans',Verdana,sans-serif;fill:#c9d4e8}"
      ".session .title{font-size:27px;font-weight:bold;fill:#fff}.session .subtitle{font-size:15px}"
      ".session .small{font-size:12.5px;fill:#93a3c0}.session .value{font-size:21px;fill:#fff}"
      ".session .letter{font-size:17px;font-weight:bold;fill:#7f91b2}";
  AppendShadeClasses(out, 'f', kFarRamp);
  AppendShadeClasses(out, 'n', kNearRamp);
  out += "</style>\n";
  Append(out, "<rect width=\"{:g}\" height=\"{:g}\" rx=\"16\" fill=\"#0a101d\"/>\n", kWidth,
         kHeight);
  Append(out, "<text x=\"{:g}\" y=\"58\" class=\"title\">{}</text>\n", kMargin,
         plot::EscapeMarkup(caption.title));
  Append(out, "<text x=\"{:g}\" y=\"88\" class=\"subtitle\">{}</text>\n", kMargin,
         plot::EscapeMarkup(caption.subtitle));
  AppendPanel(out, "overview", overview);
  AppendPanel(out, "closeup", close_up);

  // Each wall is written once; both panels refer to it.
  out += "<defs><g id=\"far\" stroke-width=\"25\" stroke-linejoin=\"round\">\n";
  AppendWall(out, shaded.far_wall, 'f');
  out += "</g><g id=\"near\" stroke-width=\"25\" stroke-linejoin=\"round\">\n";
  AppendWall(out, shaded.near_wall, 'n');
  out += "</g></defs>\n";

  const auto draw = [&](const Panel& panel, const char* name, double weight) {
    Append(out, "<g clip-path=\"url(#{})\"><g transform=\"{}\">\n<use href=\"#far\"/>\n", name,
           panel.Transform());
    AppendWire(out, seen, wire, axes, panel, weight);
    out += "<g opacity=\".32\"><use href=\"#near\"/></g>\n</g></g>\n";
  };
  draw(overview, "overview", 2.0);
  draw(close_up, "closeup", 3.4);

  const Box shown = close_up.ShownMm();
  const double scale = overview.pixels_per_mm;
  const Eigen::Vector2d corner =
      overview.pixels.center() + Eigen::Vector2d(shown.min().x() - overview.center_mm.x(),
                                                 overview.center_mm.y() - shown.max().y()) *
                                     scale;
  Append(out,
         "<rect clip-path=\"url(#overview)\" x=\"{:.1f}\" y=\"{:.1f}\" width=\"{:.1f}\" "
         "height=\"{:.1f}\" "
         "rx=\"3\" fill=\"none\" "
         "stroke=\"#c9d4e8\" stroke-opacity=\".75\" stroke-dasharray=\"5 4\"/>\n",
         corner.x(), corner.y(), shown.sizes().x() * scale, shown.sizes().y() * scale);
  for (const Panel* panel : {&overview, &close_up}) {
    AppendScaleBar(out, *panel);
    AppendOrientation(out, *panel);
  }
  AppendLegend(out, wire, close_up);
  AppendFigures(out, caption,
                Box(Eigen::Vector2d(right + 4, kTop + kCloseUpHeight + 22),
                    Eigen::Vector2d(kWidth - kMargin, kHeight - kMargin)));
  out += "</svg>\n";
  return out;
}

}  // namespace torquer
