#include "host/viewer/show_scene.h"

#include <utility>

#include "host/simulator/effects/observers/assessment.h"
#include "host/simulator/vessel/surface_net.h"
#include "host/viewer/page_messages.h"

namespace torquer::viewer {
namespace {

constexpr std::size_t kSurfaceTriangles = 100000;

std::string SurfaceFrame(scene::Scene& scene) {
  const vessel::Vessel& vessel = scene.vessel();
  const Motions motions = MotionsOf(scene);
  if (vessel.surface) return VesselFrame(vessel.surface->mesh(), scene.content_hash(), motions);
  return VesselFrame(vessel::SurfaceInAbout(kSurfaceTriangles, *vessel.field, vessel.bounds_mm),
                     scene.content_hash(), motions);
}

// Null where the scene has none.
const effects::AssessmentTask* TaskOf(const scene::Scene& scene) {
  for (const auto& effect : scene.effects()) {
    const auto* assessment = dynamic_cast<const effects::Assessment*>(effect.get());
    if (assessment != nullptr) return &assessment->task();
  }
  return nullptr;
}

}  // namespace

SceneFrames FramesOf(scene::Scene& scene) {
  return {.vessel = SurfaceFrame(scene),
          .lines = LinesText(scene.vessel().centerlines, TaskOf(scene), scene.content_hash(),
                             MotionsOf(scene))};
}

void ShowFrames(SceneFrames frames, PageServer& server) {
  server.ShowBytes("vessel", std::move(frames.vessel));
  server.ShowText("lines", std::move(frames.lines));
}

}  // namespace torquer::viewer
