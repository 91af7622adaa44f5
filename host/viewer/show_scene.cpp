#include "host/viewer/show_scene.h"

#include "host/simulator/effects/imaging/fluoroscopy.h"
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

// Null where the scene has no such effect.
template <class Kind>
const Kind* Find(const scene::Scene& scene) {
  for (const auto& effect : scene.effects()) {
    if (const auto* found = dynamic_cast<const Kind*>(effect.get())) return found;
  }
  return nullptr;
}

}  // namespace

void ShowScene(scene::Scene& scene, PageServer& server) {
  const std::uint64_t hash = scene.content_hash();
  server.ShowBytes("vessel", SurfaceFrame(scene));
  const auto* assessment = Find<effects::Assessment>(scene);
  server.ShowText("lines", LinesText(scene.vessel().centerlines,
                                     assessment == nullptr ? nullptr : &assessment->task(), hash));
  if (const auto* fluoroscopy = Find<effects::Fluoroscopy>(scene)) {
    // As wide as the picture is at the isocenter.
    const effects::CArm& arm = fluoroscopy->settings().arm;
    server.ShowText("arm", ArmText(arm.detector_mm * arm.sod_mm / arm.sid_mm, hash));
  }
}

}  // namespace torquer::viewer
