// A vessel, and the kinds of vessels that a scene can have.
//
// A kind is one file pair in kinds/ and one line in kinds/registry.cpp.
#pragma once

#include <Eigen/Core>
#include <Eigen/Geometry>
#include <any>
#include <filesystem>
#include <functional>
#include <memory>
#include <string>
#include <vector>

#include "host/simulator/core/clearance_field.h"
#include "host/simulator/vessel/brick_field.h"
#include "host/simulator/vessel/centerline.h"
#include "host/simulator/vessel/mesh_vessel.h"
#include "host/support/key_table.h"

namespace torquer::vessel {

/// Vessel, with the data for people and for the relaxation.
struct Vessel {
  std::shared_ptr<const ClearanceField> field;  ///< the distance to the wall
  /// Bricks fitted to `field`, which the wire looks up because they cost less. Null: it looks up
  /// `field`.
  std::shared_ptr<const BrickField> bricks;
  std::shared_ptr<const MeshVessel> surface;  ///< the source surface; null for other kinds
  CenterlineNetwork centerlines;              ///< may be empty for surfaces
  Eigen::AlignedBox3d bounds_mm;
  std::string description;            ///< one line
  std::vector<std::string> findings;  ///< findings and repairs, one sentence each
  /// Bytes of its files as parsed, surface first. They distinguish this vessel from another version
  /// of the same file. Scene drops them.
  std::vector<std::string> contents;

  /// The field that the wire looks up.
  const ClearanceField& wire_field() const {
    return bricks != nullptr ? static_cast<const ClearanceField&>(*bricks) : *field;
  }
};

/// One row of the table of kinds.
struct VesselKind {
  std::string name;     ///< vessel.kind
  std::string summary;  ///< one line for people
  AnyKeys keys;         ///< in addition to the keys of every vessel
  /// Builds a vessel; paths are relative to `folder`. Throws UserError.
  std::function<Vessel(const std::any& spec, const std::filesystem::path& folder)> build;
};

/// The row of a kind with keys of type Keys<Spec>, which must outlive it.
template <class Spec>
VesselKind MakeVesselKind(std::string name, std::string summary, const Keys<Spec>& keys,
                          Vessel (*build)(const Spec&, const std::filesystem::path&)) {
  return {std::move(name), std::move(summary), Any(keys),
          [build](const std::any& spec, const std::filesystem::path& folder) {
            return build(std::any_cast<const Spec&>(spec), folder);
          }};
}

const std::vector<VesselKind>& AllVesselKinds();

}  // namespace torquer::vessel
