// LCM's datagrams, written as its description has them, and a socket that sends them.
#pragma once

#include <cstdint>
#include <string>

#include "tests/support/sample_messages.h"

namespace torquer::test {

/// A whole message.
Bytes WholeDatagram(const std::string& channel, const Bytes& data);

/// The numbers in a fragment's header; nothing holds them to what follows.
struct FragmentHeader {
  std::uint32_t number = 1;  ///< of the message, of this sender
  std::uint32_t size = 0;    ///< of the message
  std::uint32_t offset = 0;  ///< of the fragment in it
  std::uint16_t fragment = 0;
  std::uint16_t fragments = 1;
};
/// `rest` is data; in the first fragment the channel and its zero before it.
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
