#include "tests/support/raw_client.h"

#include <arpa/inet.h>
#include <netinet/in.h>
#include <poll.h>
#include <sys/socket.h>
#include <sys/time.h>
#include <unistd.h>

#include <array>
#include <chrono>
#include <stdexcept>

namespace torquer::test {

RawClient::RawClient(std::uint16_t port, int receive_buffer_bytes)
    : socket_(socket(AF_INET, SOCK_STREAM | SOCK_CLOEXEC, 0)) {
  const timeval patience{5, 0};
  setsockopt(socket_, SOL_SOCKET, SO_RCVTIMEO, &patience, sizeof patience);
  if (receive_buffer_bytes > 0) {
    setsockopt(socket_, SOL_SOCKET, SO_RCVBUF, &receive_buffer_bytes, sizeof receive_buffer_bytes);
  }
  sockaddr_in address{};
  address.sin_family = AF_INET;
  address.sin_port = htons(port);
  address.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
  if (connect(socket_, reinterpret_cast<sockaddr*>(&address), sizeof address) != 0) {
    close(socket_);
    throw std::runtime_error("cannot connect");
  }
}

RawClient::~RawClient() { close(socket_); }

bool RawClient::Send(const std::string& bytes) const {
  return send(socket_, bytes.data(), bytes.size(), MSG_NOSIGNAL) ==
         static_cast<ssize_t>(bytes.size());
}

void RawClient::Finish() const { shutdown(socket_, SHUT_WR); }

std::string RawClient::ReadAll() const {
  std::string all;
  std::array<char, 65536> part{};
  ssize_t size = 0;
  while ((size = recv(socket_, part.data(), part.size(), 0)) > 0) {
    all.append(part.data(), static_cast<std::size_t>(size));
  }
  return all;
}

bool RawClient::Closed() const {
  const auto end = std::chrono::steady_clock::now() + std::chrono::seconds(60);
  std::array<char, 65536> part{};
  while (std::chrono::steady_clock::now() < end) {
    pollfd readable{socket_, POLLIN, 0};
    if (poll(&readable, 1, 100) == 0) continue;
    if (recv(socket_, part.data(), part.size(), 0) <= 0) return true;
  }
  return false;
}

bool RawClient::Upgrade(const std::string& path, const std::string& host,
                        const std::string& origin) {
  const std::string request = "GET " + path + " HTTP/1.1\r\nHost: " + host +
                              (origin.empty() ? "" : "\r\nOrigin: " + origin) +
                              "\r\nUpgrade: websocket\r\nConnection: Upgrade\r\n"
                              "Sec-WebSocket-Version: 13\r\n"
                              "Sec-WebSocket-Key: dGhlIHNhbXBsZSBub25jZQ==\r\n\r\n";
  if (!Send(request)) return false;
  std::string head;
  while (head.find("\r\n\r\n") == std::string::npos) {
    const std::string next = ReadExactly(1);
    if (next.empty()) break;
    head += next;
  }
  return StatusOf(head) == 101;
}

std::string RawClient::ReadExactly(std::size_t size) {
  std::array<char, 65536> part{};
  while (read_.size() < size) {
    const ssize_t got = recv(socket_, part.data(), part.size(), 0);
    if (got <= 0) return "";
    read_.append(part.data(), static_cast<std::size_t>(got));
  }
  std::string out = read_.substr(0, size);
  read_.erase(0, size);
  return out;
}

std::optional<RawClient::Message> RawClient::Next() {
  static constexpr int kPing = 9;
  static constexpr int kPong = 10;
  Message message;
  bool last = false;
  while (!last) {
    const std::string head = ReadExactly(2);
    if (head.empty()) return {};
    const int opcode = head[0] & 0x0f;
    std::size_t size = static_cast<unsigned char>(head[1]) & 0x7f;
    if (size >= 126) {
      const std::string bytes = ReadExactly(size == 126 ? 2 : 8);
      size = 0;
      for (const char byte : bytes) size = 256 * size + static_cast<unsigned char>(byte);
    }
    const std::string content = size > 0 ? ReadExactly(size) : "";
    if (opcode == kPing) {  // may come between frames of a message
      SendFrame(kPong, content);
      continue;
    }
    last = (head[0] & 0x80) != 0;
    if (opcode != 0) message.opcode = opcode;
    message.content += content;
  }
  return message;
}

bool RawClient::SendFrame(int opcode, const std::string& content) const {
  std::string frame(1, static_cast<char>(0x80 | opcode));
  if (content.size() < 126) {
    frame += static_cast<char>(0x80 | content.size());
  } else {
    frame += static_cast<char>(0x80 | 127);
    for (int shift = 56; shift >= 0; shift -= 8) {
      frame += static_cast<char>(content.size() >> static_cast<unsigned>(shift));
    }
  }
  return Send(frame + std::string(4, '\0') + content);  // masked with zeros
}

int StatusOf(const std::string& response) {
  return response.rfind("HTTP/1.1 ", 0) == 0 ? std::stoi(response.substr(9, 3)) : 0;
}

}  // namespace torquer::test
