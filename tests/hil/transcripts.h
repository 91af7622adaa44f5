// Conversations that every bench device must support, emulated or real: the requests in order, and
// the expected answers. Each restores the state of the device. The hand rests.
#pragma once

#include "calibration/focus.h"
#include "tests/support/usb_program.h"

namespace torquer::hil {

/// Checks that descriptors, strings and identity agree with the protocol and with each other.
void DescribesItself(Program& program);

/// Checks that `reports` arrive in sequence, one millisecond apart on the device's clock; those of
/// two sensors in turn. Up to
/// `may_miss` per thousand may be missing because the machine, not the device, is late.
void SendsEveryFrame(Program& program, int reports, int may_miss);

/// Checks that a configuration is accepted, stored, kept over a restart and read back, and that
/// invalid ones are refused.
void KeepsItsConfiguration(Program& program);

/// Checks that every unknown request is stalled and that the next request is served.
void RefusesNonsense(Program& program);

/// Checks that an endpoint halted by the host stalls, and continues after it is cleared.
void HaltsAndGoesOn(Program& program);

/// Checks that canceled and abandoned transfers do not change the device.
void OutlivesGivenUpTransfers(Program& program);

/// Checks that a command restarts the device by its watchdog. It comes back with a new boot id and
/// reports the reason; counts, time and sequence restart.
void RestartsByItsWatchdog(Program& program);

/// Checks that the sensor answers. Since the device's start there must be no restart, no loss and
/// no nearly full stack.
void IsInGoodHealth(Program& program);

/// --- open points of the sensor and of the USB, which only silicon settles -----------------------

/// Checks that rows of requests in both directions are served. The status stage of each read stays
/// unreleased until the next SETUP packet.
void ServesRowsOfRequests(Program& program, int rounds);

/// Checks that for `reports` no bit of a rest mode is seen, and none of a reset: no fault.
void RestsWithoutFault(Program& program, int reports);

/// Checks that after a restart the sensor runs without an image (SROM) and sees the surface.
void RunsWithoutAnImage(Program& program);

/// Motion in the frames of the sensor's checks over that of all frames. The wire must be in steady
/// motion; the test fails if it moves too little. About 1 if no motion is lost when the burst is
/// armed again.
double LeastShareOfMotion(Program& program, int reports);

/// Figures of a picture by the sensor's own lamp.
calibration::FocusFigures LampFigures(Program& program);

}  // namespace torquer::hil
