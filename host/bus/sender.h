// Sender and arrival time of a message.
#pragma once

#include <compare>
#include <cstdint>
#include <string>

namespace torquer::bus {

/// One connection of one process to the bus, identified by the source address of its datagrams. All
/// zero if the bus does not provide it (a log played as a bus, a bus within the process).
struct Sender {
  std::uint32_t address = 0;  ///< IPv4, as a number
  std::uint16_t port = 0;

  auto operator<=>(const Sender&) const = default;
};

/// Sender and arrival time of one message.
struct Arrival {
  Sender sender;
  std::int64_t received_us = 0;  ///< by MonotonicUs(), before the message was queued
};

/// Text such as "127.0.0.1:40123"; "port 40123" if this machine's datagrams have no address; "an
/// unknown sender" if all is zero.
std::string Describe(const Sender& sender);

}  // namespace torquer::bus
