// Private network for a test program, so that its LCM messages meet no other program's.
#pragma once

namespace torquer::test {

/// Restarts this program under host/bus/private_network, unless it already runs there. Must be
/// called first in a test case that uses LCM or needs an empty network.
void NeedPrivateNetwork();

/// Same, with umockdev's library preloaded. A mocked /dev and /sys can then replace the real ones
/// for this program and its children.
void NeedPrivateNetworkAndDevices();

}  // namespace torquer::test
