#include "host/study/cases/case_parts.h"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <utility>

#include "host/simulator/vessel/phantoms.h"

namespace torquer::study {

using Eigen::Vector3d;

namespace {

// The phantom is built once and outlives its users.
const vessel::TubeVessel& Phantom() {
  static const vessel::TubeVessel vessel = vessel::MakeTyPhantom();
  return vessel;
}

}  // namespace

std::shared_ptr<const ClearanceField> PhantomField() {
  return {std::shared_ptr<void>(), Phantom().field.get()};
}

std::vector<Vector3d> PhantomPath() {
  std::vector<Vector3d> path;
  const auto& main = Phantom().centerlines.curves()[0];
  for (double s = 0.5; s < 280; s += 0.5) path.push_back(main.At(s).position_mm);
  return path;
}

Sheath PhantomEntry() { return {Phantom().entry_point_mm(), Phantom().entry_direction()}; }

std::vector<InstrumentPoses> Feed(double from, double to, double step_mm, double rotation_rad) {
  std::vector<InstrumentPoses> script;
  const int count = std::max(1, static_cast<int>(std::ceil(std::abs(to - from) / step_mm)));
  for (int k = 1; k <= count; ++k) {
    script.emplace_back(from + (to - from) * k / count, rotation_rad);
  }
  return script;
}

void Append(std::vector<InstrumentPoses> more, std::vector<InstrumentPoses>& script) {
  script.insert(script.end(), more.begin(), more.end());
}

HardScene IntoPhantom(WireParameters p, double stiffness_N_mm2,
                      std::vector<InstrumentPoses> script) {
  p.sheath = PhantomEntry();
  if (p.tip_mm == 0) {
    p.tip_mm = 10;
    p.tip_curvature_1_per_mm = std::numbers::pi / 40;
  }
  return {PhantomField(), MakeWire(p), {.stiffness_N_mm2 = stiffness_N_mm2}, std::move(script)};
}

HardScene StraightIntoPhantom(WireParameters p, double stiffness_N_mm2,
                              std::vector<InstrumentPoses> script) {
  p.sheath = PhantomEntry();
  return {PhantomField(), MakeWire(p), {.stiffness_N_mm2 = stiffness_N_mm2}, std::move(script)};
}

}  // namespace torquer::study
