// Mocked machine whose programs may end at any moment.
#pragma once

#include <umockdev.h>

namespace torquer::emulator {

/// Makes a mocked machine by umockdev_testbed_new(); always use this function. From the first call
/// on, connect() and sendmsg() of this process tolerate programs that end during an event. Without
/// this, libumockdev would abort (umockdev_machine.cpp).
UMockdevTestbed* NewMockedMachine();

}  // namespace torquer::emulator
