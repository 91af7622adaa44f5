// Fuzz target for scans (.mha): the reader, and a small picture of the body that it gives.
#include <charconv>
#include <cmath>
#include <stdexcept>
#include <string_view>

#include "host/simulator/effects/imaging/ct_body.h"
#include "tests/fuzz/target.h"
#include "tests/support/ct_phantom.h"

namespace torquer::fuzz::scan_target {
namespace {

using Eigen::Vector3d;

Bytes File(const effects::CtVolume& scan) {
  return ToBytes(test::MetaHeader(scan) + test::BytesOf(scan));
}

std::vector<Bytes> Seeds() {
  const auto ramp = [](const Vector3d& at) { return 100 * at[0] - 40 * at[2]; };
  return {File(test::ScanOf({4, 3, 2}, 2, {5, -7, 11}, ramp)),
          File(test::ScanOf({5, 5, 6}, 1, {0, 0, 0}, ramp))};
}

bool Accepts(std::span<const std::uint8_t> input) {
  constexpr int kPixels = 8;
  const effects::CtBody body(effects::ReadCtVolume(FileWith(input), {}),
                             effects::CtAttenuation(60, 70), Vector3d::UnitZ());
  effects::CArm arm;
  arm.width = arm.height = kPixels;
  const effects::Projection projection(arm, 0.3, 0.1);
  effects::Plane plane;
  plane.Clear(kPixels, kPixels);
  double sum = body.MiddleIntegral(projection);
  sum += static_cast<double>(body.FillCoarsely(projection, plane));
  body.Refine(projection, 0, effects::CtBody::FineParts(1000, plane), plane);
  for (const float integral : plane.value) sum += static_cast<double>(integral);
  if (!std::isfinite(sum)) throw std::logic_error("an integral through the scan is not finite");
  return true;
}

// Gives the file the length that its field DimSize wants.
void Repair(Bytes& input) {
  constexpr std::string_view kSize = "DimSize =", kEnd = "ElementDataFile = LOCAL\n";
  constexpr std::size_t kMostVoxels = 1000;
  const std::string text = ToText(input);
  const std::size_t begin = text.find(kSize), end = text.find(kEnd);
  if (begin == std::string::npos || end == std::string::npos) return;
  const char* at = text.data() + begin + kSize.size();
  std::size_t voxels = 1;
  for (int axis = 0; axis < 3; ++axis) {
    while (*at == ' ') ++at;
    std::size_t count = 0;
    const auto [next, error] = std::from_chars(at, text.data() + text.size(), count);
    if (error != std::errc() || count > kMostVoxels) return;
    voxels *= count;
    at = next;
  }
  if (voxels <= kMostVoxels) input.resize(end + kEnd.size() + 2 * voxels);
}

const Registration kRegistration(
    {.name = "scan", .seeds = Seeds, .accepts = Accepts, .repair = Repair, .replay_inputs = 12000});

}  // namespace
}  // namespace torquer::fuzz::scan_target
