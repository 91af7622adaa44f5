// Small vascular trees and scenes for tests of flow, contrast and fluoroscopy.
#pragma once

#include <fstream>
#include <string>
#include <vector>

#include "host/simulator/scene/scene.h"
#include "host/simulator/simulation.h"
#include "host/support/error.h"
#include "tests/support/temporary_folder.h"

namespace torquer::test {

/// A vessel that runs 100 mm along x and forks into two of 80 mm, all of 3 mm radius. A wire of 60
/// mm lies in it.
inline const std::string kFork = R"(
[vessel]
kind = "tubes"
wall_stiffness_N_mm2 = 1
[[vessel.tube]]
name = "stem"
points_mm = [[0, 0, 0], [100, 0, 0]]
radii_mm = [3]
[[vessel.tube]]
name = "left"
points_mm = [[100, 0, 0], [180, 40, 0]]
radii_mm = [3]
[[vessel.tube]]
name = "right"
points_mm = [[100, 0, 0], [180, -40, 0]]
radii_mm = [3]
[entry]
centerline = "stem"
at_mm = 1
[[instrument]]
max_length_mm = 150
radius_mm = 0.3
rigidity_N_mm2 = 1
inserted_at_start_mm = 60
)";

/// A straight vessel of 200 mm and radius 2 mm along x.
inline const std::string kStraight = R"(
[vessel]
kind = "tubes"
wall_stiffness_N_mm2 = 1
[[vessel.tube]]
name = "tube"
points_mm = [[0, 0, 0], [200, 0, 0]]
radii_mm = [2]
[entry]
centerline = "tube"
at_mm = 1
[[instrument]]
max_length_mm = 150
radius_mm = 0.3
rigidity_N_mm2 = 1
inserted_at_start_mm = 40
)";

/// Scene from a text, in its own temporary folder.
class SceneOf {
 public:
  explicit SceneOf(const std::string& text) {
    std::ofstream(Beside("test.toml")) << "name = \"test\"\n" << text;
    scene_ = std::make_unique<scene::Scene>(Beside("test.toml"));
  }
  std::string Beside(const std::string& name) const { return folder_.Path() + "/" + name; }
  scene::Scene& operator*() { return *scene_; }
  scene::Scene* operator->() { return scene_.get(); }

  template <class EffectType>
  EffectType& Get() {
    for (const auto& effect : scene_->effects()) {
      if (auto* found = dynamic_cast<EffectType*>(effect.get())) return *found;
    }
    throw UserError("the scene lacks that effect");
  }

 private:
  TemporaryFolder folder_;
  std::unique_ptr<scene::Scene> scene_;
};

/// Error message for a scene of that text; "" if it is accepted.
inline std::string Refusal(const std::string& text) {
  try {
    const SceneOf scene(text);
  } catch (const UserError& error) {
    return error.what();
  }
  return "";
}

/// Reading of a session's observers by name; -1 if there is none.
inline double Reading(const simulator::Simulation& session, const std::string& name) {
  for (const effects::Reading& reading : session.Readings()) {
    if (reading.name == name) return reading.value;
  }
  return -1;
}

}  // namespace torquer::test
