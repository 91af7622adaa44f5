#include "host/simulator/effects/imaging/fluoroscopy_attenuation.h"

#include <algorithm>
#include <cmath>
#include <numbers>

#include "host/simulator/effects/imaging/picture_band.h"

namespace torquer::effects {

using Eigen::Vector3d;

namespace {

// Integral of the chord 2 sqrt(r^2 - x^2) of a circle from its middle to x.
double ChordIntegral(double x, double r) {
  const double c = std::clamp(x, -r, r);
  return c * std::sqrt(std::max(0.0, r * r - c * c)) + r * r * std::asin(c / r);
}

void AddWirePiece(const Projection& projection, const WirePoint& a, const WirePoint& b,
                  Plane& plane) {
  const Vector3d pa = projection.ToCamera(a.position_mm);
  const Vector3d pb = projection.ToCamera(b.position_mm);
  if (pa[2] < kNearestMm || pb[2] < kNearestMm) return;
  const ImagePoint ia = projection.FromCamera(pa);
  const ImagePoint ib = projection.FromCamera(pb);
  const Vector3d middle = (pa + pb) / 2;
  const double depth_mm = middle[2];
  const double pixels_per_mm = projection.PixelsPerMm(depth_mm);
  double along_column = ib.column - ia.column;
  double along_row = ib.row - ia.row;
  const double length = std::hypot(along_column, along_row);
  const double radius_mm = (a.radius_mm + b.radius_mm) / 2;
  // A piece seen end-on is as deep as it is long. It is drawn slightly longer and keeps its mass.
  constexpr double kLeastPixels = 0.05;
  if (length < 1e-9) {
    along_column = 1;
    along_row = 0;
  } else {
    along_column /= length;
    along_row /= length;
  }
  const double drawn = std::max(length, kLeastPixels);
  // Length along the ray per mm across it, which preserves the mass of the piece.
  const double length_mm = (pb - pa).norm();
  const double slant = length_mm / (drawn / pixels_per_mm);
  const double ray =
      std::sqrt(1 + (middle[0] * middle[0] + middle[1] * middle[1]) / (depth_mm * depth_mm));
  const double attenuation = (a.attenuation_1_mm + b.attenuation_1_mm) / 2;
  constexpr double kHalf = 0.5;  // of a pixel
  const double half_mm = kHalf / pixels_per_mm;
  const double scale = attenuation * slant * ray / (2 * half_mm);
  const Band band{ia.column,
                  ia.row,
                  along_column,
                  along_row,
                  -kHalf,
                  drawn + kHalf,
                  radius_mm * pixels_per_mm + kHalf};
  int first_row = 0;
  int last_row = -1;
  band.Rows(plane.height, first_row, last_row);
  for (int row = first_row; row <= last_row; ++row) {
    int first = 0;
    int last = -1;
    if (!band.Columns(row, plane.width, first, last)) continue;
    for (int column = first; column <= last; ++column) {
      const double x = column - ia.column;
      const double y = row - ia.row;
      const double along = x * along_column + y * along_row;
      const double covered = std::min(along + kHalf, drawn) - std::max(along - kHalf, 0.0);
      if (covered <= 0) continue;
      const double across_mm = (y * along_column - x * along_row) / pixels_per_mm;
      const double chords = ChordIntegral(across_mm + half_mm, radius_mm) -
                            ChordIntegral(across_mm - half_mm, radius_mm);
      plane.At(column, row) += static_cast<float>(scale * covered * chords);
    }
  }
}

}  // namespace

void AddWire(const Projection& projection, const std::vector<WirePoint>& wire, Plane& plane) {
  for (std::size_t i = 1; i < wire.size(); ++i) {
    AddWirePiece(projection, wire[i - 1], wire[i], plane);
  }
}

void PlaneGrid::AddTo(Plane& plane) const {
  const float share = 1 / static_cast<float>(step);
  for (int row = 0; row < plane.height; ++row) {
    const float y = share * static_cast<float>(row % step);
    const float* const above = &value[IndexOf(0, row / step)];
    const float* const below = above + columns;
    float* out = &plane.At(0, row);
    for (int cell = 0; cell + 1 < columns; ++cell) {
      const float left = above[cell] + y * (below[cell] - above[cell]);
      const float right = above[cell + 1] + y * (below[cell + 1] - above[cell + 1]);
      const int inside = std::min(step, plane.width - cell * step);
      for (int n = 0; n < inside; ++n) {
        const float x = share * static_cast<float>(n);
        *out++ += left + x * (right - left);
      }
    }
  }
}

namespace {

// Section of a ray in an elliptic cylinder along the patient's axis: length, and its middle's
// position along that axis.
struct Chord {
  double length_mm = 0;
  double middle_s_mm = 0;
};

Chord EllipseChord(const Vector3d& from, const Vector3d& ray, double half_width_mm,
                   double half_depth_mm) {
  // Coordinates: left, posterior, superior.
  const double x = from[0] / half_width_mm;
  const double y = from[1] / half_depth_mm;
  const double dx = ray[0] / half_width_mm;
  const double dy = ray[1] / half_depth_mm;
  const double a = dx * dx + dy * dy;
  const double b = x * dx + y * dy;
  const double discriminant = b * b - a * (x * x + y * y - 1);
  if (discriminant <= 0 || a < 1e-12) return {};
  return {2 * std::sqrt(discriminant) / a * ray.norm(), from[2] - b / a * ray[2]};
}

// `organs`: displacement of the organs, in the patient's coordinates.
double BodyIntegral(const Body& body, const Vector3d& from, const Vector3d& ray,
                    const Vector3d& organs) {
  const Chord tissue = EllipseChord(from, ray, body.width_mm / 2, body.depth_mm / 2);
  double sum = body.tissue_1_mm * tissue.length_mm;
  // Vertebrae: a posterior column, denser every 34 mm, with edges softened by two shells.
  const Vector3d spine_from = from - Vector3d(0, 0.28 * body.depth_mm, 0);
  const double size = body.depth_mm / 220;
  for (const double shell : {1.0, 0.75}) {
    const Chord bone = EllipseChord(spine_from, ray, 21 * shell * size, 19 * shell * size);
    const double wave = std::cos(2 * std::numbers::pi * bone.middle_s_mm / (34 * size));
    sum += 0.5 * body.spine_1_mm * bone.length_mm * (0.85 + 0.2 * wave);
  }
  // Organs: slow waves over the middle of the body.
  const double t =
      -(from[0] * ray[0] + from[1] * ray[1]) / (ray[0] * ray[0] + ray[1] * ray[1] + 1e-12);
  const Vector3d m = from + t * ray - organs;
  sum += 0.06 * body.tissue_1_mm * tissue.length_mm *
         (std::sin(m[0] / 41 + 0.7) * std::cos(m[2] / 53) + 0.6 * std::sin((m[0] + m[2]) / 27) +
          0.5 * std::cos((m[2] - 0.6 * m[0]) / 19 + 2));
  return sum;
}

Eigen::Matrix3d ToPatient(const Body& body) {
  Eigen::Matrix3d patient;
  patient.row(0) = body.axes.left;
  patient.row(1) = body.axes.posterior;
  patient.row(2) = body.axes.superior;
  return patient;
}

}  // namespace

double MiddleIntegral(const Projection& projection, const Body& body) {
  if (body.width_mm <= 0) return 0;
  const Eigen::Matrix3d patient = ToPatient(body);
  return BodyIntegral(body, patient * (projection.source_mm() - body.center_mm),
                      patient * projection.camera().row(2).transpose(), patient * body.organs_mm);
}

float FillWithBody(const Projection& projection, const Body& body, Plane& plane) {
  if (body.width_mm <= 0) return 0;
  constexpr int kGrid = 8;
  PlaneGrid grid(plane, kGrid);
  const Eigen::Matrix3d patient = ToPatient(body);
  const Vector3d from = patient * (projection.source_mm() - body.center_mm);
  const Vector3d organs = patient * body.organs_mm;
  const Eigen::Matrix3d to_patient = patient * projection.camera().transpose();
  double mean = 0;
  int measured = 0;
  for (int r = 0; r < grid.rows; ++r) {
    for (int c = 0; c < grid.columns; ++c) {
      const Vector3d ray =
          to_patient * Vector3d(projection.RightOf(c * kGrid), projection.UpOf(r * kGrid), 1);
      const double integral = BodyIntegral(body, from, ray, organs);
      grid.At(c, r) = static_cast<float>(integral);
      if (!grid.IsMiddle(c, r)) continue;
      mean += integral;
      ++measured;
    }
  }
  grid.AddTo(plane);
  return static_cast<float>(mean / measured);
}

void Blur(Plane& plane, Plane& scratch) {
  const int w = plane.width;
  const int h = plane.height;
  scratch.width = w;
  scratch.height = h;
  scratch.value.resize(plane.value.size());
  for (int row = 0; row < h; ++row) {
    const float* const in = &plane.At(0, row);
    float* const out = &scratch.At(0, row);
    out[0] = 0.75F * in[0] + 0.25F * in[1];
    for (int c = 1; c + 1 < w; ++c) out[c] = 0.5F * in[c] + 0.25F * (in[c - 1] + in[c + 1]);
    out[w - 1] = 0.75F * in[w - 1] + 0.25F * in[w - 2];
  }
  for (int row = 0; row < h; ++row) {
    const float* const in = &scratch.At(0, row);
    const float* const above = &scratch.At(0, std::max(0, row - 1));
    const float* const below = &scratch.At(0, std::min(h - 1, row + 1));
    float* const out = &plane.At(0, row);
    for (int c = 0; c < w; ++c) out[c] = 0.5F * in[c] + 0.25F * (above[c] + below[c]);
  }
}

}  // namespace torquer::effects
