#include "host/simulator/scene_message.h"

#include "host/support/fnv1a.h"
#include "protocol/lcm_channels.h"

namespace torquer::simulator {

namespace {

void Copy(const Eigen::Vector3d& from, double (&to)[3]) {
  for (int axis = 0; axis < 3; ++axis) to[axis] = from[axis];
}

}  // namespace

torquer_lcm::scene_description_t Describe(const Simulation& simulation) {
  const scene::Scene& scene = simulation.scene();
  torquer_lcm::scene_description_t out;
  out.lcm_version = protocol::kLcmVersion;
  out.name = scene.name();
  out.scene_file = scene.path();
  out.content_hash = Hex(simulation.content_hash_at_start());
  out.vessel = scene.vessel().description;
  out.method = scene.method() == scene::Method::kPaper ? "paper" : "newton";
  out.effects = scene.effect_names();
  out.effect_count = static_cast<std::int32_t>(out.effects.size());
  out.segment_mm = scene.stack().empty_rod().segment_mm();
  const InstrumentPoses start = scene.start();
  for (int k = 0; k < start.size(); ++k) {
    const effects::Instrument& instrument = scene.instruments()[static_cast<std::size_t>(k)];
    out.instruments.push_back(instrument.name);
    out.radius_mm.push_back(instrument.model->radius_mm(0));
    out.inner_radius_mm.push_back(instrument.inner_radius_mm);
    out.max_length_mm.push_back(instrument.model->max_length_mm());
    out.inserted_at_start_mm.push_back(start[k].insertion_mm);
  }
  out.instrument_count = start.size();
  Copy(scene.vessel().bounds_mm.min(), out.bounds_min_mm);
  Copy(scene.vessel().bounds_mm.max(), out.bounds_max_mm);
  Copy(scene.stack().empty_rod().sheath().point_mm, out.entry_point_mm);
  Copy(scene.stack().empty_rod().sheath().direction, out.entry_direction);
  Copy(scene.axes().left, out.left);
  Copy(scene.axes().posterior, out.posterior);
  Copy(scene.axes().superior, out.superior);
  return out;
}

}  // namespace torquer::simulator
