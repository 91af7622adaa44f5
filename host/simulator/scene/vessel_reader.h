// The [vessel] table of a scene: phantom, tubes or surface.
#pragma once

#include <cstdint>
#include <filesystem>
#include <string>
#include <vector>

#include "host/simulator/scene/scene.h"
#include "host/support/strict_toml.h"

namespace torquer::scene {

class VesselReader {
 public:
  /// `folder`: where the scene file stands; its paths are relative to it.
  VesselReader(StrictTable& file, std::filesystem::path folder)
      : table_(file.Table("vessel")), folder_(std::move(folder)) {}

  /// Throws UserError naming file, line, key, value and remedy.
  Vessel Read();
  /// Files read besides the scene.
  const std::vector<std::string>& files() const { return files_; }

 private:
  Vessel ReadPhantom();
  Vessel ReadTubes();
  Vessel ReadSurface();

  StrictTable& table_;
  const std::filesystem::path folder_;
  std::vector<std::string> files_;
};

/// FNV-1a over the bytes of the files, in order.
std::uint64_t HashFiles(const std::string& first, const std::vector<std::string>& others);

}  // namespace torquer::scene
