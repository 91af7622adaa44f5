// Mesh vessel: a vessel from a surface file, repaired, measured and as a field. It uses the results
// of an earlier run.
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
  /// Folder of built fields; empty: no cache.
  std::string cache_folder = DefaultCacheFolder();
};

class MeshVessel {
 public:
  /// Reads and repairs a surface, or takes an earlier run's result if file and options are the
  /// same. Builds no brick: look-ups, Prefetch and Build of the field do. Throws UserError naming
  /// the file.
  static std::unique_ptr<MeshVessel> Open(const std::string& path,
                                          const MeshVesselOptions& options = {});
  /// As Open, from the file's bytes. `path` names it in messages; its extension gives the format.
  static std::unique_ptr<MeshVessel> Make(const std::string& contents, const std::string& path,
                                          const MeshVesselOptions& options = {});

  const BrickField& field() const { return *field_; }
  const TriangleMesh& mesh() const { return surface_->mesh(); }
  const TriangleBvh& surface() const { return *surface_; }
  const MeshReport& report() const { return report_; }
  /// Sentences about the cache: the origin of the field, or the reason to build it again.
  const std::vector<std::string>& cache_findings() const { return cache_findings_; }
  bool from_cache() const { return from_cache_; }

  /// Saves the built field for the next run. Has no effect without a folder, or without new results
  /// since the opening or the last call. Safe concurrently with look-ups. Returns the reason of a
  /// failure, otherwise empty: a run without a cache starts slower, but is correct.
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
      -1;  // built here at the last save; -1: mesh unsaved
};

}  // namespace torquer::vessel
