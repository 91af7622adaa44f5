#include "tests/bus/datagrams.h"

#include <arpa/inet.h>
#include <sys/socket.h>
#include <unistd.h>

#include <stdexcept>

namespace torquer::test {
namespace {

constexpr std::uint16_t kPort = 7667;

// Big-endian.
std::string Number(std::uint32_t value, int size) {
  std::string bytes;
  for (int k = size - 1; k >= 0; --k) bytes += static_cast<char>(value >> 8 * k);
  return bytes;
}

Bytes ToBytes(const std::string& text) { return {text.begin(), text.end()}; }

}  // namespace

Bytes WholeDatagram(const std::string& channel, const Bytes& data) {
  return ToBytes("LC02" + Number(7, 4) + channel + '\0' + std::string(data.begin(), data.end()));
}

Bytes FragmentDatagram(const FragmentHeader& header, const std::string& rest) {
  return ToBytes("LC03" + Number(header.number, 4) + Number(header.size, 4) +
                 Number(header.offset, 4) + Number(header.fragment, 2) +
                 Number(header.fragments, 2) + rest);
}

DatagramSocket::DatagramSocket() : socket_(socket(AF_INET, SOCK_DGRAM | SOCK_CLOEXEC, 0)) {
  sockaddr_in any{};
  any.sin_family = AF_INET;
  if (socket_ < 0 || bind(socket_, reinterpret_cast<const sockaddr*>(&any), sizeof any) != 0) {
    throw std::runtime_error("no socket to send from");
  }
}

DatagramSocket::~DatagramSocket() { close(socket_); }

void DatagramSocket::Send(const Bytes& datagram, const std::string& address,
                          int time_to_live) const {
  setsockopt(socket_, IPPROTO_IP, IP_MULTICAST_TTL, &time_to_live, sizeof time_to_live);
  sockaddr_in to{};
  to.sin_family = AF_INET;
  to.sin_port = htons(kPort);
  inet_pton(AF_INET, address.c_str(), &to.sin_addr);
  if (sendto(socket_, datagram.data(), datagram.size(), 0, reinterpret_cast<const sockaddr*>(&to),
             sizeof to) < 0) {
    throw std::runtime_error("a datagram cannot be sent to " + address);
  }
}

std::uint16_t DatagramSocket::port() const {
  sockaddr_in own{};
  socklen_t size = sizeof own;
  getsockname(socket_, reinterpret_cast<sockaddr*>(&own), &size);
  return ntohs(own.sin_port);
}

}  // namespace torquer::test
