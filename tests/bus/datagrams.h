// LCM datagrams written as LCM's description specifies, and a socket that sends them.
#pragma once

#include <cstdint>
#include <string>

#include "tests/support/sample_messages.h"

namespace torquer::test {

/// A whole message.
Bytes WholeDatagram(const std::string& channel, const Bytes& data);

/// Numbers in a fragment's header; they need not agree with the data that follows.
struct FragmentHeader {
  std::uint32_t number = 1;  ///< of the message, counted per sender
  std::uint32_t size = 0;    ///< of the message, in bytes
  std::uint32_t offset = 0;  ///< of the fragment within the message, in bytes
  std::uint16_t fragment = 0;
  std::uint16_t fragments = 1;
};
/// `rest` is the payload; in the first fragment it begins with the channel name and its zero byte.
Bytes FragmentDatagram(const FragmentHeader& header, const std::string& rest);

/// Sends datagrams from its own port to LCM's usual multicast group, or to `address`.
class DatagramSocket {
 public:
  DatagramSocket();
  ~DatagramSocket();
  DatagramSocket(const DatagramSocket&) = delete;
  DatagramSocket& operator=(const DatagramSocket&) = delete;

  void Send(const Bytes& datagram, const std::string& address = "239.255.76.67",
            int time_to_live = 0) const;
  std::uint16_t port() const;

 private:
  int socket_;
};

}  // namespace torquer::test
