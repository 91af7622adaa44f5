// A vessel from a surface file: repaired, measured and as a field, with what an earlier run has
// built.
#pragma once

#include <atomic>
#include <cstdint>
#include <memory>
#include <string>
#include <vector>

#include "host/simulator/vessel/brick_field.h"
#include "host/simulator/vessel/field_cache.h"
#include "host/simulator/vessel/surface_mesh.h"
#include "host/simulator/vessel/triangle_bvh.h"

namespace torquer::vessel {

struct MeshVesselOptions {
  MeshUnit unit = MeshUnit::kMillimeter;
  BrickFieldOptions field;
  /// Where built fields are kept; empty: nowhere.
  std::string cache_folder = DefaultCacheFolder();
};

class MeshVessel {
 public:
  /// Reads and repairs a surface, or takes an earlier run's result if file and options are the
  /// same. Builds no brick: look-ups, Prefetch and Build of the field do. Throws UserError naming
  /// the file.
  static std::unique_ptr<MeshVessel> Open(const std::string& path,
                                          const MeshVesselOptions& options = {});
  /// The same of the file's bytes; `path` names it in messages, and its ending says the format.
  static std::unique_ptr<MeshVessel> Make(const std::string& contents, const std::string& path,
                                          const MeshVesselOptions& options = {});

  const BrickField& field() const { return *field_; }
  const TriangleMesh& mesh() const { return surface_->mesh(); }
  const TriangleBvh& surface() const { return *surface_; }
  const MeshReport& report() const { return report_; }
  /// Sentences about the cache: from where the field came, or why not.
  const std::vector<std::string>& cache_findings() const { return cache_findings_; }
  bool from_cache() const { return from_cache_; }

  /// Keeps what is built for the next run; does nothing where there is no folder, or nothing new
  /// since this was opened or tried last.
  /// Safe beside look-ups. Returns why it could not, empty otherwise: a run without a cache is
  /// slower to start, not wrong.
  std::string SaveCache() const;

 private:
  MeshVessel() = default;

  std::shared_ptr<const TriangleBvh> surface_;
  MeshReport report_;
  std::unique_ptr<BrickField> field_;
  CacheKey key_;
  std::string cache_path_;
  std::vector<std::string> cache_findings_;
  bool from_cache_ = false;
  mutable std::atomic<std::int64_t> bricks_kept_ =
      -1;  // of those built here; -1: not even the mesh
};

}  // namespace torquer::vessel
