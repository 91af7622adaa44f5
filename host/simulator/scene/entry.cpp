#include "host/simulator/scene/entry.h"

#include "host/simulator/core/frames.h"
#include "host/support/error.h"

namespace torquer::scene {

using Eigen::Vector3d;

namespace {

constexpr double kPathStepMm = 0.5;

// Place and direction of an entry, and samples of the centerline from there on.
struct Way {
  vessel::CenterlineSample start;
  std::vector<vessel::CenterlineSample> samples;
};

void Follow(const vessel::Centerline& curve, double from_mm, Way& way) {
  for (double s = from_mm; s < curve.length_mm(); s += kPathStepMm) {
    way.samples.push_back(curve.At(s));
  }
}

// With `towards` the way leads to that place, otherwise along the curve.
Way FindWay(const EntrySpec& spec, const vessel::CenterlineNetwork& network) {
  if (network.empty()) {
    spec.origin.Refuse("centerline", "this vessel has no centerlines; give point_mm and direction");
  }
  const auto place = [&](const char* key, const std::string& curve, double at_mm) {
    try {
      return network.Place(curve, at_mm);
    } catch (const UserError& error) {
      spec.origin.Refuse(key, error.what());
    }
  };
  const vessel::CenterlinePlace from = place("centerline", *spec.centerline, spec.at_mm);
  Way way{.start = network.At(from), .samples = {}};
  if (!spec.towards) {
    Follow(network.curves()[from.curve], from.s_mm, way);
    return way;
  }
  const vessel::CenterlinePlace to = place("towards", *spec.towards, spec.towards_at_mm);
  try {
    const vessel::Centerline path = network.Path(from, to);
    way.start = path.At(0);
    Follow(path, 0, way);
  } catch (const UserError& error) {
    spec.origin.Refuse("towards", error.what());
  }
  return way;
}

// Samples of a path of points from `start` on, with the direction of the leg that ends there.
std::vector<vessel::CenterlineSample> SamplesOf(const std::vector<Vector3d>& path_mm,
                                                const vessel::CenterlineSample& start) {
  std::vector<vessel::CenterlineSample> samples;
  vessel::CenterlineSample last = start;
  for (const Vector3d& point : path_mm) {
    const Vector3d leg = point - last.position_mm;
    last.position_mm = point;
    if (leg.norm() > 0) last.tangent = leg.normalized();
    samples.push_back(last);
  }
  return samples;
}

// Moves an entry and its path across their tangents. The normals are carried along the path.
void MoveAcross(const Eigen::Vector2d& offset_mm, const Way& way, Entry& entry) {
  Vector3d tangent = entry.sheath.direction;
  Vector3d normal = SheathNormal(tangent);
  const auto offset = [&]() -> Vector3d {
    return offset_mm[0] * normal + offset_mm[1] * tangent.cross(normal);
  };
  entry.sheath.point_mm += offset();
  for (std::size_t k = 0; k < way.samples.size(); ++k) {
    normal = ParallelTransport(normal, tangent, way.samples[k].tangent);
    tangent = way.samples[k].tangent;
    entry.start_path_mm[k] += offset();
  }
}

}  // namespace

Entry FindEntry(const EntrySpec& spec, const vessel::CenterlineNetwork& network) {
  Way way;
  if (spec.point_mm) {
    way.start = {.position_mm = *spec.point_mm, .tangent = spec.direction->normalized()};
    way.samples = SamplesOf(spec.path_mm, way.start);
  } else {
    way = FindWay(spec, network);
  }
  Entry entry{.sheath = {way.start.position_mm, way.start.tangent.normalized()},
              .start_path_mm = {}};
  for (const vessel::CenterlineSample& sample : way.samples) {
    entry.start_path_mm.push_back(sample.position_mm);
  }
  if (!spec.offset_mm.isZero(0)) MoveAcross(spec.offset_mm, way, entry);
  return entry;
}

}  // namespace torquer::scene
