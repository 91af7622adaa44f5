// Mocked machine whose programs may end at any moment.
#pragma once

#include <umockdev.h>

namespace torquer::emulator {

/// Makes a mocked machine by umockdev_testbed_new(); always use this function. Without it,
/// libumockdev aborts if a program ends during an event, or does not read its events
/// (umockdev_machine.cpp). From the first call on, connect() and sendmsg() of this process tolerate
/// such programs.
UMockdevTestbed* NewMockedMachine();

}  // namespace torquer::emulator
