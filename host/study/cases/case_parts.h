// Parts of the hard cases: hands, and wires in the T-Y phantom.
#pragma once

#include <Eigen/Core>
#include <cstddef>
#include <memory>
#include <random>
#include <vector>

#include "host/simulator/core/clearance_field.h"
#include "host/simulator/core/wire_model.h"
#include "host/study/cases/hard_cases.h"
#include "host/study/cases/simple_wire.h"

namespace torquer::study {

inline constexpr double kNominalRigidity = 6.35e-3;

std::shared_ptr<const ClearanceField> PhantomField();
/// Points on the phantom's main centerline, 0.5 mm apart.
std::vector<Eigen::Vector3d> PhantomPath();
Sheath PhantomEntry();

/// Targets from `from` to `to` in equal steps of at most `step_mm`.
std::vector<InstrumentPoses> Feed(double from, double to, double step_mm, double rotation_rad = 0);
void Append(std::vector<InstrumentPoses> more, std::vector<InstrumentPoses>& script);

/// Wire into the phantom, with a tip curved by 45 degrees.
HardScene IntoPhantom(WireParameters p, double stiffness_N_mm2,
                      std::vector<InstrumentPoses> script);
/// Wire into the phantom with a straight tip: head-on into the T.
HardScene StraightIntoPhantom(WireParameters p, double stiffness_N_mm2,
                              std::vector<InstrumentPoses> script);

template <class... Values>
double OneOf(std::mt19937& random, Values... values) {
  const double all[] = {values...};
  return all[std::uniform_int_distribution<std::size_t>(0, sizeof...(values) - 1)(random)];
}

/// Adds the cases with other vessels than the phantom, and those with other starts of the wire.
void AddShapes(std::vector<HardCase>& cases);
void AddVoxels(std::vector<HardCase>& cases);
void AddStarts(std::vector<HardCase>& cases);

}  // namespace torquer::study
