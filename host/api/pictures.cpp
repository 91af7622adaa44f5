// X-ray pictures of simulations.
#include <fmt/format.h>

#include <limits>
#include <utility>

#include "host/api/impl.h"
#include "host/simulator/command_limits.h"
#include "host/simulator/effects/imaging/fluoroscopy.h"
#include "host/simulator/effects/imaging/lateral_plane.h"
#include "host/support/angles.h"
#include "host/support/within.h"

namespace torquer {

namespace {

constexpr double kFarthestPoint_mm = 1e9;

void CheckPlane(int plane, int count, const std::string& scene) {
  if (count == 0) {
    throw Error(scene + ": has no X-ray picture to render; add [effects.fluoroscopy]");
  }
  if (plane >= 0 && plane < count) return;
  throw Error(fmt::format("plane {} does not exist; give 0 to {}", plane, count - 1));
}

// Projection of a plane under the settings of a command.
effects::Projection ProjectionOf(const scene::Scene& scene, int plane, const Command& command) {
  effects::Controls controls = ToControls(command);
  for (const std::unique_ptr<effects::Effect>& effect : scene.effects()) {
    if (plane == 0) {
      if (const auto* const first = dynamic_cast<const effects::Fluoroscopy*>(effect.get())) {
        return first->settings().ProjectionOf(controls);
      }
    } else if (const auto* const lateral =
                   dynamic_cast<const effects::LateralPlane*>(effect.get())) {
      controls.lao_rad = lateral->lao_rad();
      controls.cra_rad = lateral->cra_rad();
      return lateral->plane().settings().ProjectionOf(controls);
    }
  }
  throw Error(scene.name() + ": no effect takes pictures in this plane");
}

}  // namespace

void CheckImaging(const Imaging& imaging) {
  if (simulator::IsValid(ToEffects(imaging))) return;
  throw Error(fmt::format(
      "imaging has mode {}, pulses_per_s {}, magnification {}, shutters left {}, right {}, top {}, "
      "bottom {}, wedges left {} at {} deg, right {} at {} deg; give a mode of Imaging::Mode, 1 to "
      "60 pulses or 0, magnification 1 to 4, shutters 0 to 0.45, wedges 0 to 0.5 at -90 to 90 deg",
      static_cast<int>(imaging.mode), imaging.pulses_per_s, imaging.magnification, imaging.left,
      imaging.right, imaging.top, imaging.bottom, imaging.wedge_left.share,
      imaging.wedge_left.rotation_deg, imaging.wedge_right.share,
      imaging.wedge_right.rotation_deg));
}

void CheckInjector(const Injector& injector) {
  const std::string invalid = simulator::InvalidValue(ToEffects(injector));
  if (!invalid.empty()) throw Error("injector has " + invalid);
}

std::vector<PicturePlace> Simulation::PlacesInPicture(const std::vector<Point>& points_mm,
                                                      int plane) const {
  const auto hold = impl().usage.Look();
  CheckPlane(plane, picture_planes(), impl_->scene.name());
  const effects::Projection projection = ProjectionOf(*impl_->lent, plane, impl_->rows.command());
  constexpr double kUnknown = std::numeric_limits<double>::quiet_NaN();
  std::vector<PicturePlace> places;
  for (const Point& point : points_mm) {
    for (const double x : point) {
      RequireWithin<Error>("a coordinate of points_mm", x, -kFarthestPoint_mm, kFarthestPoint_mm);
    }
    const Eigen::Vector3d camera_mm = projection.ToCamera({point[0], point[1], point[2]});
    if (camera_mm[2] > 0) {
      const effects::ImagePoint at = projection.FromCamera(camera_mm);
      places.push_back({at.column, at.row});
    } else {
      places.push_back({kUnknown, kUnknown});
    }
  }
  return places;
}

int Simulation::picture_planes() const {
  const auto hold = impl().usage.Look();
  return static_cast<int>(impl_->pictures.size());
}

bool Simulation::picture_due(int plane) const {
  const auto hold = impl().usage.Look();
  return plane >= 0 && plane < static_cast<int>(impl_->pictures.size()) &&
         impl_->pictures_due[static_cast<std::size_t>(plane)];
}

const Picture& Simulation::LastPicture(int plane) {
  const auto hold = impl().usage.Work();
  CheckPlane(plane, picture_planes(), impl_->scene.name());
  const auto k = static_cast<std::size_t>(plane);
  if (!impl_->pictures_due[k]) return impl_->pictures[k];
  impl_->past.AddRendering(plane);
  effects::ImageSource::Picture taken;
  impl_->simulation->image(k)->Render(taken);
  impl_->pictures[k] = {.width = taken.width,
                        .height = taken.height,
                        .time_s = taken.time_s,
                        .lao_deg = taken.controls.lao_rad / kRadPerDeg,
                        .cra_deg = taken.controls.cra_rad / kRadPerDeg,
                        .gray = std::move(taken.gray)};
  impl_->pictures_due[k] = false;
  return impl_->pictures[k];
}

}  // namespace torquer
