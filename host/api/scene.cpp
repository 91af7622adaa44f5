#include <fmt/format.h>

#include <cmath>
#include <filesystem>
#include <utility>

#include "host/api/impl.h"
#include "host/api/script_columns.h"
#include "host/simulator/core/wire_model.h"
#include "host/support/error.h"
#include "host/support/within.h"
#include "torquer_version.h"

namespace torquer {

namespace {

constexpr double kMostPoints = 1e6;
constexpr double kFarthest_mm = 1e9;

std::vector<Point> Walk(const vessel::Centerline& curve, double step_mm) {
  RequireWithin<Error>("step_mm", step_mm, curve.length_mm() / kMostPoints, kFarthest_mm);
  const auto steps = static_cast<std::size_t>(std::ceil(curve.length_mm() / step_mm));
  std::vector<Point> points;
  for (std::size_t k = 0; k < steps; ++k) {
    points.push_back(ToPoint(curve.At(static_cast<double>(k) * step_mm).position_mm));
  }
  points.push_back(ToPoint(curve.At(curve.length_mm()).position_mm));
  return points;
}

// An empty folder is the working folder.
std::string Absolute(const std::filesystem::path& folder) {
  return std::filesystem::absolute(folder.empty() ? "." : folder).lexically_normal().string();
}

}  // namespace

const char* Version() { return kVersion; }

Error::Error(const std::string& message) : std::runtime_error(message) {}
Error::~Error() = default;

Scene::Impl::Impl(std::unique_ptr<scene::Scene> made, bool keeps)
    : scene(std::move(made)),
      keeps_field(keeps),
      folder(Absolute(scene->spec().folder)),
      instruments(InstrumentsOf(*scene)) {}

Scene::Impl::~Impl() {
  if (keeps_field) scene->KeepField();
}

std::shared_ptr<scene::Scene> Scene::Impl::Lend() const {
  if (lent.exchange(true)) return scene->MakeTwin();
  return {scene.get(), [this](scene::Scene*) { lent = false; }};
}

Scene::Scene(std::shared_ptr<const Impl> impl) : impl_(std::move(impl)) {}
Scene::Scene(const Scene&) = default;
Scene& Scene::operator=(const Scene&) = default;
Scene::~Scene() = default;

Scene Scene::FromFile(const std::string& path) {
  return Guarded(
      [&] { return Scene(std::make_shared<const Impl>(std::make_unique<scene::Scene>(path))); });
}

Scene Scene::FromText(const std::string& toml, const std::string& folder, const std::string& path) {
  return Guarded([&] {
    return Scene(std::make_shared<const Impl>(
        std::make_unique<scene::Scene>(scene::ParseScene(toml, path, folder))));
  });
}

Scene Scene::With(const Values& values) const {
  return Guarded([&] {
    const scene::Scene& base = *impl_->scene;
    return Scene(std::make_shared<const Impl>(
        std::make_unique<scene::Scene>(scene::With(base.spec(), values), base)));
  });
}

std::string Scene::KeepField() const { return impl_->scene->KeepField(); }
const std::string& Scene::name() const { return impl_->scene->name(); }
const std::string& Scene::path() const { return impl_->scene->path(); }
std::string Scene::text() const { return scene::WriteScene(impl_->scene->spec()); }
const std::string& Scene::folder() const { return impl_->folder; }
std::uint64_t Scene::content_hash() const { return impl_->scene->content_hash(); }
const std::vector<InstrumentInfo>& Scene::instruments() const { return impl_->instruments; }
std::vector<std::string> Scene::effects() const { return impl_->scene->effect_names(); }
const std::vector<std::string>& Scene::findings() const { return impl_->scene->vessel().findings; }

std::vector<ScriptRow> Scene::ParseScript(const std::string& csv, const std::string& path) const {
  return Guarded([&] { return torquer::ParseScript(csv, path, this->path(), instruments()); });
}

std::array<Point, 2> Scene::bounds_mm() const {
  const Eigen::AlignedBox3d& box = impl_->scene->vessel().bounds_mm;
  return {ToPoint(box.min()), ToPoint(box.max())};
}

double Scene::ClearanceMm(const Point& point_mm) const {
  for (const double x : point_mm) {
    RequireWithin<Error>("a coordinate of point_mm", x, -kFarthest_mm, kFarthest_mm);
  }
  return impl_->scene->vessel().field->Clearance({point_mm[0], point_mm[1], point_mm[2]});
}

std::vector<std::string> Scene::centerlines() const {
  std::vector<std::string> names;
  for (const vessel::Centerline& curve : impl_->scene->vessel().centerlines.curves()) {
    names.push_back(curve.name());
  }
  return names;
}

std::vector<Point> Scene::CenterlineMm(const std::string& name, double step_mm) const {
  return Guarded([&] {
    const vessel::CenterlineNetwork& network = impl_->scene->vessel().centerlines;
    return Walk(network.curves()[network.Find(name)], step_mm);
  });
}

void CheckInstrument(std::size_t instrument, const Scene& scene) {
  if (instrument < scene.instruments().size()) return;
  throw Error(fmt::format("there is no instrument {}; the scene has {}, numbered from 0",
                          instrument, scene.instruments().size()));
}

std::vector<Point> Scene::RouteMm(const std::string& centerline, double at_mm, double step_mm,
                                  std::size_t instrument) const {
  CheckInstrument(instrument, *this);
  return Guarded([&] {
    const vessel::CenterlineNetwork& network = impl_->scene->vessel().centerlines;
    const Sheath& sheath = impl_->scene->stack().instrument(static_cast<int>(instrument)).sheath();
    const vessel::CenterlinePlace from = network.NearestTo(sheath.point_mm);
    return Walk(network.Path(from, network.Place(centerline, at_mm)), step_mm);
  });
}

}  // namespace torquer
