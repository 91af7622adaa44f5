// Who sent a message, and when it came.
#pragma once

#include <compare>
#include <cstdint>
#include <string>

namespace torquer::bus {

/// One connection of one process to the bus, by the address that its datagrams come from. All zero
/// where the bus does not tell (a log played as a bus, a bus within the process).
struct Sender {
  std::uint32_t address = 0;  ///< IPv4, as a number
  std::uint16_t port = 0;

  auto operator<=>(const Sender&) const = default;
};

/// Where a message came from, and when.
struct Arrival {
  Sender sender;
  std::int64_t received_us = 0;  ///< by MonotonicUs(), before it waited for its turn
};

/// As "127.0.0.1:40123", or "port 40123" where the datagrams of this machine have no address; "an
/// unknown sender" for none.
std::string Describe(const Sender& sender);

}  // namespace torquer::bus
