#include "host/simulator/vessel/mesh_picture.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <vector>

#include "host/simulator/vessel/face_sample.h"

namespace torquer::vessel {

using Eigen::Vector2d;
using Eigen::Vector3d;

namespace {

constexpr double kPanel = 420, kBorder = 20, kFoot = 40;  // pixels
constexpr std::size_t kMostTriangles = 20000, kMostEdges = 20000;

// View along one axis of the file. `right`, `up` and the axis toward the eye are right-handed.
struct View {
  int right, up, eye;
  const char* name;
};
constexpr View kViews[] = {{0, 1, 2, "x to the right, y up"},
                           {2, 0, 1, "z to the right, x up"},
                           {1, 2, 0, "y to the right, z up"}};

class Panel {
 public:
  Panel(const View& view, int number, const Eigen::AlignedBox3d& box, double pixels_per_mm)
      : view_(view), center_mm_(box.center()), scale_(pixels_per_mm), left_(number * kPanel) {}

  Vector2d At(const Vector3d& p) const {
    const Vector3d off = scale_ * (p - center_mm_);
    return {left_ + kPanel / 2 + off[view_.right], kPanel / 2 - off[view_.up]};
  }
  double Height(const Vector3d& p) const { return p[view_.eye]; }
  double Facing(const Vector3d& direction) const { return direction[view_.eye]; }
  double left() const { return left_; }

 private:
  const View& view_;
  Vector3d center_mm_;
  double scale_, left_;
};

// Paint of a face as SVG attributes. facing: 0 edge-on, 1 toward the eye.
using Paint = std::string (*)(double facing);

std::string WallPaint(double facing) {
  const int gray = 120 + static_cast<int>(110 * facing);
  return fmt::format("fill='rgb({0},{0},{1})'", gray, std::min(255, gray + 15));
}

std::string LeftOutPaint(double facing) {
  return fmt::format("fill='rgb(255,{},40)' fill-opacity='0.55'",
                     110 + static_cast<int>(80 * facing));
}

// Draws the farthest triangles first. A large mesh is thinned evenly.
void AddTriangles(const TriangleMesh& mesh, Paint paint, const Panel& panel, std::string& out) {
  std::vector<std::pair<double, std::size_t>> order;
  for (const SampledFace& sample : SampleFaces(mesh, kMostTriangles)) {
    order.emplace_back(panel.Height(mesh.Centroid(sample.face)), sample.face);
  }
  std::sort(order.begin(), order.end());
  order.erase(std::unique(order.begin(), order.end()), order.end());
  for (const auto& [height, i] : order) {
    const double facing = std::abs(panel.Facing(mesh.DoubleArea(i).normalized()));
    out += fmt::format("<path {} d='M", paint(std::isfinite(facing) ? facing : 0));
    for (int corner = 0; corner < 3; ++corner) {
      const Vector2d at = panel.At(mesh.Corner(i, corner));
      out += fmt::format("{:.1f} {:.1f} ", at.x(), at.y());
    }
    out += "z'/>\n";
  }
}

void AddEdges(const TriangleMesh& mesh, const std::vector<std::array<std::int32_t, 2>>& edges,
              const char* color, const Panel& panel, std::string& out) {
  if (edges.empty()) return;
  out += fmt::format("<path fill='none' stroke='{}' stroke-width='1.5' d='", color);
  for (std::size_t i = 0; i < std::min(edges.size(), kMostEdges); ++i) {
    const Vector2d a = panel.At(mesh.vertices_mm[static_cast<std::size_t>(edges[i][0])]);
    const Vector2d b = panel.At(mesh.vertices_mm[static_cast<std::size_t>(edges[i][1])]);
    out += fmt::format("M{:.1f} {:.1f}L{:.1f} {:.1f}", a.x(), a.y(), b.x(), b.y());
  }
  out += "'/>\n";
}

void AddEntries(const std::vector<EntryProposal>& entries, double length_mm, const Panel& panel,
                std::string& out) {
  for (std::size_t i = 0; i < entries.size(); ++i) {
    const Vector2d from = panel.At(entries[i].point_mm);
    const Vector2d to = panel.At(entries[i].point_mm + length_mm * entries[i].direction);
    out += fmt::format(
        "<path stroke='#0057b8' stroke-width='2.5' marker-end='url(#head)' "
        "d='M{:.1f} {:.1f}L{:.1f} {:.1f}'/>\n<text x='{:.1f}' y='{:.1f}' "
        "fill='#0057b8'>{}</text>\n",
        from.x(), from.y(), to.x(), to.y(), from.x() + 5, from.y() - 5, i + 1);
  }
}

}  // namespace

std::string DrawCheck(const MeshCheck& check) {
  const TriangleMesh& mesh = check.surface ? check.surface->mesh : check.raw;
  if (mesh.triangles.empty()) return "";
  const Eigen::AlignedBox3d box = check.raw.Bounds();
  const double largest_mm = box.sizes().maxCoeff();
  const double scale = largest_mm > 0 ? (kPanel - 2 * kBorder) / largest_mm : 1;
  const double width = 3 * kPanel, height = kPanel + kFoot;
  std::string out = fmt::format(
      "<svg xmlns='http://www.w3.org/2000/svg' width='{0}' height='{1}' viewBox='0 0 {0} {1}' "
      "font-family='sans-serif' font-size='13'>\n<defs><marker id='head' markerWidth='5' "
      "markerHeight='5' refX='3' refY='2.5' orient='auto'><path fill='#0057b8' d='M0 0L5 2.5L0 "
      "5z'/>"
      "</marker></defs>\n<rect width='{0}' height='{1}' fill='white'/>\n",
      width, height);
  int number = 0;
  for (const View& view : kViews) {
    const Panel panel(view, number++, box, scale);
    AddTriangles(mesh, WallPaint, panel, out);
    if (check.surface) AddTriangles(check.surface->left_out, LeftOutPaint, panel, out);
    AddEdges(check.raw, check.edges.open, "#d00000", panel, out);
    AddEdges(check.raw, check.edges.several, "#c000c0", panel, out);
    AddEntries(check.entries, 0.12 * largest_mm, panel, out);
    out += fmt::format("<text x='{:g}' y='{:g}'>{}</text>\n", panel.left() + kBorder, kPanel + 12,
                       view.name);
  }
  out += fmt::format(
      "<text x='{:g}' y='{:g}'>{} {:.4g} mm wide at most; red: open edges of the file ({}); "
      "magenta: edges of more than two triangles ({}); {}blue: proposed entries</text>\n</svg>\n",
      kBorder, kPanel + 32, check.surface ? "The surface as simulated," : "The file's surface,",
      largest_mm, check.edges.open.size(), check.edges.several.size(),
      check.surface && !check.surface->left_out.triangles.empty() ? "orange: walls left out; "
                                                                  : "");
  return out;
}

}  // namespace torquer::vessel
