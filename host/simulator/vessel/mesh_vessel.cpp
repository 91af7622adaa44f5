#include "host/simulator/vessel/mesh_vessel.h"

#include <algorithm>
#include <cstring>
#include <filesystem>
#include <type_traits>
#include <utility>

#include "host/simulator/vessel/cache_folder.h"
#include "host/simulator/vessel/mesh_import.h"

namespace torquer::vessel {

namespace {

// Raise it with every change that gives another mesh or other bricks for the same file.
constexpr double kBuildVersion = 5;

// Surface and report as bytes; one function defines the order for writing and reading.
class Bytes {
 public:
  Bytes() = default;
  explicit Bytes(std::vector<char> bytes) : bytes_(std::move(bytes)), reading_(true) {}

  template <typename T>
  void Do(T& value) {
    static_assert(std::is_trivially_copyable_v<T>);
    Raw(&value, sizeof value);
  }
  void Do(std::string& text) { List(text); }
  template <typename T>
  void Do(std::vector<T>& list) {
    List(list);
  }
  void Do(Eigen::Vector3d& v) { Raw(v.data(), 3 * sizeof(double)); }
  void Do(Opening& opening) {
    Do(opening.center_mm);
    Do(opening.outward);
    Do(opening.radius_mm);
    Do(opening.inward);
  }
  bool whole() const { return whole_ && (!reading_ || at_ == bytes_.size()); }
  const std::vector<char>& bytes() const { return bytes_; }

 private:
  void Raw(void* data, size_t size) {
    if (!reading_) {
      const char* from = static_cast<const char*>(data);
      bytes_.insert(bytes_.end(), from, from + size);
    } else if (size <= bytes_.size() - at_) {
      std::memcpy(data, bytes_.data() + at_, size);
      at_ += size;
    } else {
      whole_ = false;
    }
  }
  template <typename List_>
  void List(List_& list) {
    uint64_t size = list.size();
    Raw(&size, sizeof size);
    if (reading_) {
      whole_ = whole_ && size <= bytes_.size() - at_;
      list.resize(whole_ ? size : 0);
    }
    for (auto& item : list) Do(item);
  }

  std::vector<char> bytes_;
  size_t at_ = 0;
  bool reading_ = false, whole_ = true;
};

void Do(Bytes& bytes, TriangleMesh& mesh, MeshReport& report) {
  bytes.Do(mesh.vertices_mm);
  bytes.Do(mesh.triangles);
  bytes.Do(report.findings);
  bytes.Do(report.openings);
  for (size_t* count : {&report.triangles_read, &report.vertices_welded, &report.triangles_dropped,
                        &report.triangles_turned, &report.holes_closed, &report.slivers_repaired,
                        &report.crossed_edges, &report.intersections}) {
    bytes.Do(*count);
  }
  bytes.Do(report.left_out_mm2);
  bytes.Do(report.was_inward);
  bytes.Do(report.was_shell);
  bytes.Do(report.tube_facing_share);
  bytes.Do(report.bounds_mm.min());
  bytes.Do(report.bounds_mm.max());
  bytes.Do(report.area_mm2);
  bytes.Do(report.volume_mm3);
  for (double& width : report.width_mm) bytes.Do(width);
}

// Checks the properties that the field requires without a check.
bool IsUsable(const TriangleMesh& mesh, const MeshReport& report) {
  const auto count = static_cast<int64_t>(mesh.vertices_mm.size());
  const auto is_there = [count](int32_t vertex) { return vertex >= 0 && vertex < count; };
  const Eigen::AlignedBox3d& bounds = report.bounds_mm;
  return !mesh.triangles.empty() && !bounds.isEmpty() && bounds.min().allFinite() &&
         bounds.max().allFinite() &&
         std::all_of(mesh.triangles.begin(), mesh.triangles.end(),
                     [&](const auto& t) { return std::all_of(t.begin(), t.end(), is_there); }) &&
         std::all_of(mesh.vertices_mm.begin(), mesh.vertices_mm.end(),
                     [](const Eigen::Vector3d& v) { return v.allFinite(); });
}

}  // namespace

std::unique_ptr<MeshVessel> MeshVessel::Open(const std::string& path,
                                             const MeshVesselOptions& options) {
  return Make(ReadMeshContents(path), path, options);
}

std::unique_ptr<MeshVessel> MeshVessel::Make(const std::string& contents, const std::string& path,
                                             const MeshVesselOptions& options) {
  std::unique_ptr<MeshVessel> vessel(new MeshVessel);
  CachedField cached;
  TriangleMesh mesh;
  if (!options.cache_folder.empty()) {
    CacheKey& key = vessel->key_;
    key.Add(kBuildVersion);
    // Messages about the file contain its path.
    key.Add(path.data(), path.size());
    key.Add(contents.data(), contents.size());
    key.Add(UnitOf(options.unit).mm);
    key.Add(options.field.voxel_mm);
    key.Add(options.field.band_mm);
    key.Add(options.field.margin_mm);
    vessel->cache_path_ = options.cache_folder + "/" + key.Hex() + ".field";
    std::string why;
    auto found = ReadFieldCache(vessel->cache_path_, key, &why);
    if (found) {
      Bytes bytes(std::move(found->surface));
      Do(bytes, mesh, vessel->report_);
      if (bytes.whole() && IsUsable(mesh, vessel->report_)) {
        vessel->from_cache_ = true;
        cached = std::move(*found);
      } else {
        mesh = TriangleMesh();
        vessel->report_ = MeshReport();
        why = vessel->cache_path_ + " is damaged";
      }
    }
    if (!why.empty()) vessel->cache_findings_.push_back(why + ": the field is built again.");
  }
  if (!vessel->from_cache_) {
    SurfaceMesh surface = ParseSurface(contents, path, options.unit);
    mesh = std::move(surface.mesh);
    vessel->report_ = std::move(surface.report);
  }
  vessel->surface_ = std::make_shared<const TriangleBvh>(std::move(mesh));
  vessel->field_ =
      std::make_unique<BrickField>(vessel->surface_, vessel->report_.bounds_mm, options.field);
  if (vessel->from_cache_) {
    const bool adopted =
        vessel->field_->Adopt(cached.bricks, cached.complete_levels, cached.memory);
    vessel->cache_findings_.push_back(
        adopted ? "Field taken from " + vessel->cache_path_ + "."
                : vessel->cache_path_ + " has bricks of another field: the field is built again.");
    vessel->bricks_kept_ = 0;
  }
  return vessel;
}

std::string MeshVessel::SaveCache() const {
  if (cache_path_.empty()) return "";
  const auto built = static_cast<std::int64_t>(field_->Statistics().bricks_built);
  if (bricks_kept_.exchange(built) == built) return "";
  Bytes bytes;
  TriangleMesh mesh = surface_->mesh();
  MeshReport report = report_;
  Do(bytes, mesh, report);
  const std::string problem = WriteFieldCache(cache_path_, key_, bytes.bytes(), *field_);
  TidyCacheFolder(std::filesystem::path(cache_path_).parent_path().string(), cache_path_);
  return problem;
}

}  // namespace torquer::vessel
