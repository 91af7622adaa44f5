// Simple wire: uniform rigidity, with or without a curved tip, from a few parameters.
#pragma once

#include <vector>

#include "host/simulator/core/wire_model.h"

namespace torquer::study {

/// Parameters of a wire; the defaults are the paper's wire.
struct WireParameters {
  double segment_mm = 1;
  double rigidity_N_mm2 = 6.35e-3;
  double torsional_rigidity_N_mm2 = 0;  ///< 0: rigid in torsion
  double radius_mm = 0.178;
  double tip_mm = 0;
  double tip_curvature_1_per_mm = 0;  ///< rest curvature over tip_mm
  double max_length_mm = 100;
  BendingLaw law = BendingLaw::kExact;
  Sheath sheath = {};
};

inline WireModel MakeWire(const WireParameters& p) {
  const WireSection shaft{.from_tip_mm = 0,
                          .rigidity_N_mm2 = p.rigidity_N_mm2,
                          .radius_mm = p.radius_mm,
                          .torsional_rigidity_N_mm2 = p.torsional_rigidity_N_mm2};
  std::vector<WireSection> sections = {shaft};
  sections.front().curvature_1_per_mm = p.tip_curvature_1_per_mm;
  if (p.tip_mm > 0 && p.tip_curvature_1_per_mm != 0) {
    sections.push_back(sections.front());
    sections.back().from_tip_mm = p.tip_mm;
    sections.push_back(shaft);
    sections.back().from_tip_mm = p.tip_mm + 1e-6;
  }
  return WireModel(p.segment_mm, sections, p.tip_mm, p.max_length_mm, p.law, p.sheath);
}

}  // namespace torquer::study
