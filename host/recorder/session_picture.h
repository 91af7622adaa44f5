// A picture of the wire inside the vessel, seen from the front, as SVG.
#pragma once

#include <Eigen/Core>
#include <string>
#include <utility>
#include <vector>

#include "host/recorder/vessel_shading.h"

namespace torquer {

/// Where the wire touches the wall.
struct PictureContact {
  Eigen::Vector3d point_mm;
  double penetration_um = 0;
};

/// How far an instrument reaches along the curve.
struct PictureInstrument {
  std::string name;
  double insertion_mm = 0;
};

struct PictureWire {
  std::vector<Eigen::Vector3d> nodes_mm;  ///< from the entry point to the farthest tip; at least 2
  std::vector<PictureInstrument> instruments;  ///< the innermost first; may be empty: one wire
  std::vector<PictureContact> contacts;
  std::vector<Eigen::Vector3d> tip_way_mm = {};  ///< where the tip has been; may be empty
};

/// What stands beside the drawing.
struct PictureCaption {
  std::string title;
  std::string subtitle;
  std::vector<std::pair<std::string, std::string>> figures;  ///< name, value with its unit
};

/// The whole vessel on the left, the surroundings of the tip enlarged on the right, the figures
/// below. Self-contained SVG, some hundred kB; an empty vessel leaves the wire alone.
std::string DrawSession(const PictureVessel& vessel, const PatientAxes& axes,
                        const PictureWire& wire, const PictureCaption& caption);

}  // namespace torquer
