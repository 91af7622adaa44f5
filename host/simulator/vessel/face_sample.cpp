#include "host/simulator/vessel/face_sample.h"

#include <numeric>
#include <random>

namespace torquer::vessel {

std::vector<SampledFace> SampleFaces(const TriangleMesh& mesh, std::span<const std::int32_t> faces,
                                     std::size_t most) {
  std::vector<SampledFace> sample;
  double total_mm2 = 0;
  for (const std::int32_t face : faces) {
    const auto at = static_cast<std::size_t>(face);
    const double area_mm2 = mesh.DoubleArea(at).norm() / 2;
    total_mm2 += area_mm2;
    if (faces.size() <= most) sample.push_back({at, area_mm2});
  }
  if (faces.size() <= most || !(total_mm2 > 0)) return sample;
  // One place in each of `most` equal shares of the area, anywhere within its share. Equal steps
  // would always meet the same side of a wall if both sides alternate in the file.
  std::mt19937 random(20260);
  const double share_mm2 = total_mm2 / static_cast<double>(most);
  const auto place_in = [&](std::size_t share) {
    return share_mm2 * (static_cast<double>(share) + random() / (random.max() + 1.0));
  };
  double passed_mm2 = 0, next_mm2 = place_in(0);
  for (const std::int32_t face : faces) {
    const auto at = static_cast<std::size_t>(face);
    passed_mm2 += mesh.DoubleArea(at).norm() / 2;
    while (sample.size() < most && next_mm2 < passed_mm2) {
      sample.push_back({at, share_mm2});
      next_mm2 = place_in(sample.size());
    }
  }
  return sample;
}

std::vector<SampledFace> SampleFaces(const TriangleMesh& mesh, std::size_t most) {
  std::vector<std::int32_t> all(mesh.triangles.size());
  std::iota(all.begin(), all.end(), 0);
  return SampleFaces(mesh, all, most);
}

}  // namespace torquer::vessel
