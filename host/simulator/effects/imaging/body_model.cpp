#include "host/simulator/effects/imaging/body_model.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>

namespace torquer::effects {
namespace {

using Eigen::Vector3d;

// Heights in the patient, mm above the dome of the diaphragm, which is at the tenth vertebra of the
// chest. A man of 1.75 m, by the usual proportions of anatomy; no figure is of one patient.
constexpr double kHeadMm = 405;
constexpr double kHeartMm = 40;

double HeightOf(BodyRegion region) {
  // By region; a trunk has no height.
  constexpr std::array<double, 7> kHeightsMm = {0, kHeadMm, 265, 130, kHeartMm, -110, -230};
  return kHeightsMm[static_cast<std::size_t>(region)];
}

// Place by shares of the body's width and depth.
Vector3d PlaceIn(const Body& body, double left, double posterior, double superior_mm) {
  return {left * body.width_mm, posterior * body.depth_mm, superior_mm};
}

// Line from `from` along `ray`, in the patient's coordinates: left, posterior, superior.
struct Line {
  Vector3d from;
  Vector3d ray;
};

// Part of a line within a convex shape, in units of the ray. It is empty if it ends before it
// begins.
struct Chord {
  double begin = 0;
  double end = 0;

  double length() const { return std::max(0.0, end - begin); }
};

Chord Both(const Chord& a, const Chord& b) {
  return {std::max(a.begin, b.begin), std::min(a.end, b.end)};
}

// Length of the line that lies in at least one of two chords.
double LengthOfEither(const Chord& a, const Chord& b) {
  return a.length() + b.length() - Both(a, b).length();
}

Chord Roots(double a, double b, double c) {
  const double discriminant = b * b - a * c;
  if (discriminant <= 0 || a < 1e-12) return {};
  const double root = std::sqrt(discriminant);
  return {(-b - root) / a, (-b + root) / a};
}

Chord InEllipsoid(const Line& line, const Vector3d& center, const Vector3d& half) {
  const Vector3d x = (line.from - center).cwiseQuotient(half);
  const Vector3d d = line.ray.cwiseQuotient(half);
  return Roots(d.squaredNorm(), d.dot(x), x.squaredNorm() - 1);
}

// Elliptic cylinder along the patient's axis, without ends.
Chord InColumn(const Line& line, double left_mm, double posterior_mm, double half_width_mm,
               double half_depth_mm) {
  const double x = (line.from[0] - left_mm) / half_width_mm;
  const double y = (line.from[1] - posterior_mm) / half_depth_mm;
  const double dx = line.ray[0] / half_width_mm;
  const double dy = line.ray[1] / half_depth_mm;
  return Roots(dx * dx + dy * dy, dx * x + dy * y, x * x + y * y - 1);
}

// The part of a chord below a height.
Chord Below(const Line& line, double height_mm, Chord chord) {
  if (std::abs(line.ray[2]) < 1e-12) {
    return line.from[2] <= height_mm ? chord : Chord{};
  }
  const double at = (height_mm - line.from[2]) / line.ray[2];
  if (line.ray[2] > 0) {
    chord.end = std::min(chord.end, at);
  } else {
    chord.begin = std::max(chord.begin, at);
  }
  return chord;
}

// The line in coordinates that are turned about the patient's axis through a place.
Line Turned(const Line& line, const Vector3d& about, double angle_rad) {
  const Eigen::Matrix3d turn = Eigen::AngleAxisd(angle_rad, Vector3d::UnitZ()).toRotationMatrix();
  return {about + turn * (line.from - about), turn * line.ray};
}

// Line integrals through a body, in the patient's coordinates.
class BodyIntegrals {
 public:
  explicit BodyIntegrals(const Body& body)
      : body_(body), up_mm_(HeightOf(body.region)), size_(body.depth_mm / 220) {
    patient_.row(0) = body.axes.left;
    patient_.row(1) = body.axes.posterior;
    patient_.row(2) = body.axes.superior;
    organs_ = patient_ * body.organs_mm;
  }

  const Eigen::Matrix3d& patient() const { return patient_; }

  double Along(const Line& from_center) const {
    // Heights count from the diaphragm.
    const Line line{from_center.from + Vector3d(0, 0, up_mm_), from_center.ray};
    const Chord trunk = InColumn(line, 0, 0, body_.width_mm / 2, body_.depth_mm / 2);
    const bool has_ends = body_.region != BodyRegion::kTrunk;
    double sum = (has_ends ? Tissue(line, trunk) : trunk.length()) * (1 + Organs(line));
    if (has_ends) sum -= Air(line);
    const double bone = Spine(line) + (has_ends ? Bone(line) : 0);
    return (body_.tissue_1_mm * sum + body_.spine_1_mm * bone) * line.ray.norm();
  }

 private:
  Vector3d Place(double left, double posterior, double superior_mm) const {
    return PlaceIn(body_, left, posterior, superior_mm);
  }

  // Vertebrae: a posterior column, denser every 34 mm, with edges softened by two shells.
  double Spine(const Line& line) const {
    double sum = 0;
    for (const double shell : {1.0, 0.75}) {
      Chord bone = InColumn(line, 0, 0.28 * body_.depth_mm, 21 * shell * size_, 19 * shell * size_);
      const double middle_mm = line.from[2] + (bone.begin + bone.end) / 2 * line.ray[2];
      const double wave = std::cos(2 * std::numbers::pi * middle_mm / (34 * size_));
      if (body_.region != BodyRegion::kTrunk) bone = Below(line, 330, bone);
      sum += 0.5 * bone.length() * (0.85 + 0.2 * wave);
    }
    return sum;
  }

  // Organs: slow waves over the middle of the body.
  double Organs(const Line& line) const {
    const Vector3d& from = line.from;
    const Vector3d& ray = line.ray;
    const double t =
        -(from[0] * ray[0] + from[1] * ray[1]) / (ray[0] * ray[0] + ray[1] * ray[1] + 1e-12);
    const Vector3d m = from + t * ray - organs_;
    return 0.06 *
           (std::sin(m[0] / 41 + 0.7) * std::cos(m[2] / 53) + 0.6 * std::sin((m[0] + m[2]) / 27) +
            0.5 * std::cos((m[2] - 0.6 * m[0]) / 19 + 2));
  }

  // Trunk with round shoulders, neck and head.
  double Tissue(const Line& line, const Chord& trunk) const {
    const Chord shoulders = InEllipsoid(line, Place(0, 0, 110), Place(0.5, 0.5, 115));
    const Chord neck = InEllipsoid(line, Place(0, 0.1, 250), {58, 64, 130});
    const Chord head = InEllipsoid(line, Place(0, 0, kHeadMm), HalfHead());
    const Chord below = Below(line, 110, trunk);
    // The neck begins inside the trunk.
    const double upper = LengthOfEither(neck, head);
    const double lower = LengthOfEither(below, shoulders);
    return upper + lower - Both(neck, below).length() - Both(neck, shoulders).length() +
           Both(neck, Both(below, shoulders)).length();
  }

  // Missing tissue: lungs above the diaphragm and beside the heart, and gas.
  double Air(const Line& line) const {
    constexpr double kLung = 0.74;
    double sum = 0;
    const Chord heart =
        InEllipsoid(line, Place(0.07, -0.14, kHeartMm) + organs_, Place(0.18, 0.22, 62));
    for (const double side : {-1.0, 1.0}) {
      const Chord lung = InEllipsoid(line, Place(0.25 * side, 0.02, 85), Place(0.165, 0.34, 128));
      const double dome_mm = side < 0 ? -70 : -80;  // the liver lifts the right one
      const Chord dome =
          InEllipsoid(line, Place(0.22 * side, 0, dome_mm) + organs_, Place(0.24, 0.5, 80));
      sum += kLung * (lung.length() - LengthOfEither(Both(lung, dome), Both(lung, heart)));
    }
    // Stomach and bowel.
    constexpr std::array<std::array<double, 6>, 4> kGas = {{{0.2, -0.2, -62, 0.09, 0.07, 16},
                                                            {-0.31, -0.1, -125, 0.05, 0.06, 34},
                                                            {0.3, 0.05, -118, 0.045, 0.06, 38},
                                                            {-0.06, 0, -240, 0.05, 0.06, 20}}};
    for (const auto& gas : kGas) {
      sum += 0.9 * InEllipsoid(line, Place(gas[0], gas[1], gas[2]) + organs_,
                               Place(gas[3], gas[4], gas[5]))
                       .length();
    }
    // Air of the trachea, the throat and the sinuses.
    const Chord trachea = InColumn(line, 0, -0.02 * body_.depth_mm, 8, 7);
    sum += 0.9 * (Below(line, 320, trachea).length() - Below(line, 125, trachea).length());
    for (const double side : {-1.0, 1.0}) {
      sum += 0.9 * InEllipsoid(line, {20 * side, -62, 372}, {14, 14, 16}).length();
    }
    return sum;
  }

  // Skull and pelvis, as a length in bone like that of the spine.
  double Bone(const Line& line) const {
    const Vector3d head = Place(0, 0, kHeadMm);
    const double table = InEllipsoid(line, head, HalfHead() - Vector3d(4, 4, 4)).length() -
                         InEllipsoid(line, head, HalfHead() - Vector3d(10, 10, 10)).length();
    const double base = InEllipsoid(line, {0, 8, 352}, {58, 62, 9}).length();
    double sum = 2 * table + base;
    for (const double side : {-1.0, 1.0}) {
      const Vector3d wing = Place(0.25 * side, 0.08, -215);
      sum += 1.5 * InEllipsoid(Turned(line, wing, 0.7 * side), wing, {9, 0.24 * body_.depth_mm, 70})
                       .length();
      const Vector3d hip = Place(0.28 * side, 0, -292);
      sum += InEllipsoid(line, hip, Vector3d::Constant(24 * size_)).length();
    }
    return sum;
  }

  static Vector3d HalfHead() { return {76, 96, 108}; }  // half axes, mm

  const Body& body_;
  double up_mm_;
  double size_;  // of the spine and the hips; 1 in a body of 220 mm
  Eigen::Matrix3d patient_;
  Vector3d organs_;
};

// Makes the tubes, in the scene's coordinates.
class TubeMaker {
 public:
  explicit TubeMaker(const Body& body) : body_(body), up_mm_(HeightOf(body.region)) {}

  BodyTubes Make() {
    BodyTubes tubes;
    for (const double side : {-1.0, 1.0}) {
      for (int number = 1; number <= 12; ++number) tubes.bones.push_back(Rib(side, number));
      tubes.bones.push_back(Clavicle(side));
      AddHip(side, tubes);
      Branch(Place(0.11 * side, 0.04, 98), {0.5 * side, 0.1, 0.6}, 5, 5, tubes);
      Branch(Place(0.11 * side, 0.04, 90), {0.8 * side, -0.2, -0.2}, 5, 5, tubes);
      Branch(Place(0.11 * side, 0.04, 82), {0.5 * side, 0.2, -0.8}, 5.5, 5, tubes);
    }
    tubes.bones.push_back({Jaw(-44, 8, 352), Jaw(-42, -14, 332), Jaw(-26, -48, 325),
                           Jaw(0, -60, 324), Jaw(26, -48, 325), Jaw(42, -14, 332),
                           Jaw(44, 8, 352)});
    tubes.bones.push_back({At(Place(0, -0.44, 20), 11, 0.3), At(Place(0, -0.4, 150), 13, 0.4)});
    return tubes;
  }

 private:
  Vector3d Place(double left, double posterior, double superior_mm) const {
    return PlaceIn(body_, left, posterior, superior_mm);
  }
  // `share`: of the spine's excess.
  WirePoint At(const Vector3d& there, double radius_mm, double share) const {
    return {ToScene(there), radius_mm, share * body_.spine_1_mm};
  }
  Vector3d ToScene(const Vector3d& there) const {
    return body_.center_mm + there[0] * body_.axes.left + there[1] * body_.axes.posterior +
           (there[2] - up_mm_) * body_.axes.superior;
  }

  WirePoint Jaw(double left_mm, double posterior_mm, double superior_mm) const {
    return At({left_mm, posterior_mm, superior_mm}, 7, 1);
  }

  // Ring of the pelvis, and the thigh bone.
  void AddHip(double side, BodyTubes& tubes) const {
    const WirePoint joint = At(Place(0.27 * side, 0, -290), 10, 0.8);
    const WirePoint front = At(Place(0.03 * side, -0.26, -302), 9, 0.8);
    tubes.bones.push_back({joint, front});
    tubes.bones.push_back({joint, At(Place(0.2 * side, 0.06, -345), 10, 0.8), front});
    tubes.bones.push_back({joint, At(Place(0.36 * side, 0.02, -310), 15, 0.8),
                           At(Place(0.35 * side, 0.02, -450), 14, 1)});
  }

  // From the spine around the side to the front, where it ends in cartilage, and lower than it
  // began.
  std::vector<WirePoint> Rib(double side, int number) const {
    constexpr std::array<double, 12> kWidth = {0.2,  0.28, 0.34,  0.38, 0.4,  0.415,
                                               0.42, 0.42, 0.415, 0.4,  0.38, 0.36};
    constexpr std::array<double, 12> kEndDeg = {150, 152, 152, 150, 146, 142,
                                                138, 130, 122, 112, 85,  60};
    const double width = kWidth[static_cast<std::size_t>(number - 1)];
    const double end = kEndDeg[static_cast<std::size_t>(number - 1)];
    const double depth = 0.44 * (0.6 + 0.4 * width / 0.42);
    const double top_mm = 205 - 24.0 * (number - 1);
    const double drop_mm = 30 + 45 * std::min(1.0, number / 6.0);
    std::vector<WirePoint> rib;
    for (double degrees = 17; degrees <= end; degrees += 9) {
      const double angle = degrees * std::numbers::pi / 180;
      const double fallen = drop_mm * (1 - std::cos(angle)) / 2;
      rib.push_back(At(
          Place(side * width * std::sin(angle), depth * std::cos(angle), top_mm - fallen), 5, 0.9));
    }
    return rib;
  }

  std::vector<WirePoint> Clavicle(double side) const {
    return {At(Place(0.06 * side, -0.36, 172), 8, 0.9), At(Place(0.2 * side, -0.4, 186), 5.5, 1),
            At(Place(0.34 * side, -0.22, 198), 5.5, 1), At(Place(0.42 * side, -0.12, 200), 7, 0.9)};
  }

  // A vessel of the lung and its branches.
  void Branch(const Vector3d& from, const Vector3d& towards, double radius_mm, int generations,
              BodyTubes& tubes) {
    const Vector3d way = towards.normalized();
    const double length_mm = 10 + 4 * radius_mm;
    const Vector3d to = from + length_mm * way;
    const double attenuation_1_mm = 0.74 * body_.tissue_1_mm;
    tubes.lung_vessels.push_back({{ToScene(from), radius_mm, attenuation_1_mm},
                                  {ToScene(to), 0.85 * radius_mm, attenuation_1_mm}});
    if (generations == 0) return;
    // A vector across the way, other at each branch.
    turn_ += 2.399963;  // golden angle
    const Vector3d a = way.cross(Vector3d(0.2, 0.9, 0.4)).normalized();
    const Vector3d b = way.cross(a);
    const Vector3d across = std::cos(turn_) * a + std::sin(turn_) * b;
    Branch(to, way + 0.35 * across, 0.78 * radius_mm, generations - 1, tubes);
    Branch(to, way - 0.6 * across, 0.66 * radius_mm, generations - 1, tubes);
  }

  const Body& body_;
  double up_mm_;
  double turn_ = 0;
};

// Adds the chords of a ball, `scale` times.
void AddBall(const Projection& projection, const Vector3d& center_mm, double radius_mm,
             double scale_1_mm, Plane& plane) {
  const Vector3d at = projection.ToCamera(center_mm);
  if (at[2] < radius_mm) return;
  const ImagePoint middle = projection.FromCamera(at);
  const double per_mm = projection.PixelsPerMm(at[2]);
  const double radius = radius_mm * per_mm;
  const int first_row = std::max(0, static_cast<int>(std::ceil(middle.row - radius)));
  const int last_row = std::min(plane.height - 1, static_cast<int>(middle.row + radius));
  const auto scale = static_cast<float>(2 * scale_1_mm / per_mm);
  for (int row = first_row; row <= last_row; ++row) {
    const double y = row - middle.row;
    const double half = std::sqrt(std::max(0.0, radius * radius - y * y));
    const int first = std::max(0, static_cast<int>(std::ceil(middle.column - half)));
    const int last = std::min(plane.width - 1, static_cast<int>(middle.column + half));
    for (int column = first; column <= last; ++column) {
      const double x = column - middle.column;
      plane.At(column, row) +=
          scale * std::sqrt(static_cast<float>(std::max(0.0, half * half - x * x)));
    }
  }
}

// Adds a tube as a row of balls that has its volume. Unlike a band, it is round from all sides.
void AddTube(const Projection& projection, const std::vector<WirePoint>& tube,
             const Vector3d& moved_mm, Plane& plane) {
  for (std::size_t i = 1; i < tube.size(); ++i) {
    const WirePoint& a = tube[i - 1];
    const WirePoint& b = tube[i];
    const double length_mm = (b.position_mm - a.position_mm).norm();
    const double least_mm = std::min(a.radius_mm, b.radius_mm);
    const int balls = std::max(1, static_cast<int>(std::ceil(length_mm / (0.6 * least_mm))));
    for (int k = 0; k < balls; ++k) {
      const double t = (k + 0.5) / balls;
      const double radius_mm = a.radius_mm + t * (b.radius_mm - a.radius_mm);
      const double attenuation_1_mm =
          a.attenuation_1_mm + t * (b.attenuation_1_mm - a.attenuation_1_mm);
      AddBall(projection, a.position_mm + t * (b.position_mm - a.position_mm) + moved_mm, radius_mm,
              attenuation_1_mm * 0.75 * length_mm / (balls * radius_mm), plane);
    }
  }
}

}  // namespace

void AddTubes(const Projection& projection, const Body& body, Plane& plane) {
  if (body.tubes == nullptr) return;
  for (const std::vector<WirePoint>& bone : body.tubes->bones) {
    AddTube(projection, bone, Vector3d::Zero(), plane);
  }
  for (const std::vector<WirePoint>& vessel : body.tubes->lung_vessels) {
    AddTube(projection, vessel, body.organs_mm, plane);
  }
}

std::shared_ptr<const BodyTubes> TubesOf(const Body& body) {
  if (body.region == BodyRegion::kTrunk || body.width_mm <= 0) return nullptr;
  return std::make_shared<const BodyTubes>(TubeMaker(body).Make());
}

double MiddleIntegral(const Projection& projection, const Body& body) {
  if (body.width_mm <= 0) return 0;
  const BodyIntegrals integrals(body);
  return integrals.Along({integrals.patient() * (projection.source_mm() - body.center_mm),
                          integrals.patient() * projection.camera().row(2).transpose()});
}

float FillWithBody(const Projection& projection, const Body& body, Plane& plane) {
  if (body.width_mm <= 0) return 0;
  // Lungs and skull have edges.
  const int every = body.region == BodyRegion::kTrunk ? 8 : 4;
  PlaneGrid grid(plane, every);
  const BodyIntegrals integrals(body);
  const Vector3d from = integrals.patient() * (projection.source_mm() - body.center_mm);
  const Eigen::Matrix3d to_patient = integrals.patient() * projection.camera().transpose();
  double mean = 0;
  int measured = 0;
  for (int r = 0; r < grid.rows; ++r) {
    for (int c = 0; c < grid.columns; ++c) {
      const Vector3d ray =
          to_patient * Vector3d(projection.RightOf(c * every), projection.UpOf(r * every), 1);
      const double integral = integrals.Along({from, ray});
      grid.At(c, r) = static_cast<float>(integral);
      if (!grid.IsMiddle(c, r)) continue;
      mean += integral;
      ++measured;
    }
  }
  grid.AddTo(plane);
  return static_cast<float>(mean / measured);
}

}  // namespace torquer::effects
