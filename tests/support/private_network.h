// Puts a test program into its own network, so that LCM messages meet no other program's.
#pragma once

namespace torquer::test {

/// Starts this program again under host/bus/private_network, unless it runs there already. Call it
/// first thing in a test case that uses LCM or counts on an empty network.
void NeedPrivateNetwork();

/// The same, and with umockdev's library preloaded, so that a mocked /dev and /sys can be laid over
/// the real ones for this program and its children.
void NeedPrivateNetworkAndDevices();

}  // namespace torquer::test
