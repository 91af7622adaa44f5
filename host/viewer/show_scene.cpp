#include "host/viewer/show_scene.h"

#include "host/simulator/effects/observers/assessment.h"
#include "host/simulator/vessel/surface_net.h"
#include "host/viewer/page_messages.h"

namespace torquer::viewer {
namespace {

constexpr std::size_t kSurfaceTriangles = 100000;

std::string SurfaceFrame(scene::Scene& scene) {
  const vessel::Vessel& vessel = scene.vessel();
  const bool moves = scene.moving_field() != nullptr;
  if (vessel.surface) return VesselFrame(vessel.surface->mesh(), scene.content_hash(), moves);
  return VesselFrame(vessel::SurfaceInAbout(kSurfaceTriangles, *vessel.field, vessel.bounds_mm),
                     scene.content_hash(), moves);
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

void ShowScene(scene::Scene& scene, PageServer& server) {
  server.ShowBytes("vessel", SurfaceFrame(scene));
  server.ShowText("lines",
                  LinesText(scene.vessel().centerlines, TaskOf(scene), scene.content_hash()));
}

}  // namespace torquer::viewer
