// Limits of the values of a command. Commands beyond them are refused.
#pragma once

#include <string>

#include "host/simulator/core/instrument_pose.h"
#include "host/simulator/effects/effect.h"

namespace torquer::simulator {

/// Largest distance and angle that a target may have, mm or rad, in both directions.
inline constexpr double kPoseLimit = 1e5;
/// True if a pose is finite and within kPoseLimit.
bool IsValid(const InstrumentPose& pose);
/// True if all settings of the X-ray system are within their ranges.
bool IsValid(const effects::Imaging& imaging);
/// First invalid value of the power injector's order or set-up, with its remedy; "" without one.
/// An example is "rate_mL_s 60; give 0.1 to 45, or -1 for the scene's value".
std::string InvalidValue(const effects::Injector& injector);
/// True if the table's position is within its ranges.
bool IsValid(const effects::Table& table);
/// True if the C-arm's angles are finite and within half a turn. Does not check the rest.
bool IsValid(const effects::Controls& controls);

}  // namespace torquer::simulator
