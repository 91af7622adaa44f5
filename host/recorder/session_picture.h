// Picture of the wire inside the vessel, seen from the front, as SVG.
#pragma once

#include <Eigen/Core>
#include <string>
#include <utility>
#include <vector>

#include "host/recorder/vessel_shading.h"

namespace torquer {

/// Contact of the wire with the wall.
struct PictureContact {
  Eigen::Vector3d point_mm;
  double penetration_um = 0;
};

/// Instrument and its insertion along its curve.
struct PictureInstrument {
  std::string name;
  double insertion_mm = 0;
  std::vector<Eigen::Vector3d> nodes_mm = {};  ///< up to its tip; empty: on the wire's curve
};

struct PictureWire {
  std::vector<Eigen::Vector3d>
      nodes_mm;  ///< of the innermost curve up to its farthest tip; at least 2
  std::vector<PictureInstrument> instruments;    ///< the innermost first; may be empty: one wire
  std::vector<PictureContact> contacts;          ///< of the innermost curve
  std::vector<Eigen::Vector3d> tip_way_mm = {};  ///< path of the tip; may be empty
};

/// Texts beside the drawing.
struct PictureCaption {
  std::string title;
  std::string subtitle;
  std::vector<std::pair<std::string, std::string>> figures;  ///< name, value with its unit
};

/// Draws the whole vessel on the left, an enlarged view of the tip on the right, the figures below.
/// The SVG is self-contained and has some hundred kB. With an empty vessel only the wire is drawn.
std::string DrawSession(const PictureVessel& vessel, const PatientAxes& axes,
                        const PictureWire& wire, const PictureCaption& caption);

}  // namespace torquer
