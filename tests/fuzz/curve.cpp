// Fuzz target for centerlines in the format of 3D Slicer.
#include <nlohmann/json.hpp>

#include "host/simulator/vessel/centerline.h"
#include "tests/fuzz/target.h"

namespace torquer::fuzz::curve_target {
namespace {

std::vector<Bytes> Seeds() {
  using nlohmann::json;
  json controls = json::array();
  for (int i = 0; i < 4; ++i) {
    controls.push_back({{"position", {10.5 * i, i * i, -3}}, {"positionStatus", "defined"}});
  }
  const json measurement = {{"name", "Radius"}, {"controlPointValues", {1.5, 2, 2.5, 3}}};
  const json markup = {{"type", "Curve"},
                       {"coordinateUnits", "mm"},
                       {"controlPoints", controls},
                       {"measurements", json::array({measurement})}};
  const json document = {{"markups", json::array({markup})}};
  return {ToBytes(document.dump()), ToBytes(document.dump(1))};
}

bool Accepts(std::span<const std::uint8_t> input) {
  const vessel::Centerline curve = vessel::ParseSlicerCurve({"curve.mrk.json", ToText(input)});
  curve.At(0.3 * curve.length_mm());
  return true;
}

const Registration kRegistration(
    {.name = "curve", .seeds = Seeds, .accepts = Accepts, .replay_inputs = 12000});

}  // namespace
}  // namespace torquer::fuzz::curve_target
