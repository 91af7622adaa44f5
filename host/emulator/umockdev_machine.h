// A mocked machine that programs may leave at any moment.
#pragma once

#include <umockdev.h>

namespace torquer::emulator {

/// A new mocked machine, as umockdev_testbed_new() makes it: the one way to make one. From the
/// first call on, connect() and sendmsg() of this process bear with programs that end while an
/// event is sent to them: libumockdev alone would abort (umockdev_machine.cpp).
UMockdevTestbed* NewMockedMachine();

}  // namespace torquer::emulator
