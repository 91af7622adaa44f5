// Conversations that every bench device must support, emulated or real: the requests in order, and
// the expected answers. Each restores the state of the device. The hand rests.
#pragma once

#include "tests/support/usb_program.h"

namespace torquer::hil {

/// Checks that descriptors, strings and identity agree with the protocol and with each other.
void DescribesItself(Program& program);

/// Checks that `reports` arrive in sequence, one millisecond apart on the device's clock. Up to
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

/// Checks that the sensor answers, and that since the device's start there was no restart, no loss
/// and no nearly full stack.
void IsInGoodHealth(Program& program);

}  // namespace torquer::hil
