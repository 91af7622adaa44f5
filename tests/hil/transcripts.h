// Conversations with a bench device that hold for any, the emulated one and silicon: what is said
// to it, in order, and what it must answer. Each leaves the device as it was. The hand lies still.
#pragma once

#include "tests/support/usb_program.h"

namespace torquer::hil {

/// Descriptors, strings and identity agree with the protocol and with each other.
void DescribesItself(Program& program);

/// So many reports, each the next of the one before, a millisecond apart on the device's clock.
/// `may_miss` of a thousand may be missing where the machine, not the device, is late.
void SendsEveryFrame(Program& program, int reports, int may_miss);

/// A configuration is taken, kept over a restart, and given back; what makes no sense is refused.
void KeepsItsConfiguration(Program& program);

/// Requests that there are not are stalled, one and all, and the next one is served.
void RefusesNonsense(Program& program);

/// The endpoint halted by the host stalls; cleared, it goes on.
void HaltsAndGoesOn(Program& program);

/// Transfers that the program gives up, or does not wait for, leave the device as it was.
void OutlivesGivenUpTransfers(Program& program);

/// On command the device restarts by its watchdog, comes back by itself as another boot, and says
/// why; counts, time and sequence begin again.
void RestartsByItsWatchdog(Program& program);

/// The sensor answers, nothing was restarted, lost or nearly full since the device's start.
void IsInGoodHealth(Program& program);

}  // namespace torquer::hil
