// Raw client that can send any bytes over TCP, with as much HTTP and WebSocket as tests need.
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

namespace torquer::test {

class RawClient {
 public:
  /// Connects to 127.0.0.1. receive_buffer_bytes sets the kernel's buffer; 0 keeps its default.
  explicit RawClient(std::uint16_t port, int receive_buffer_bytes = 0);
  ~RawClient();
  RawClient(const RawClient&) = delete;
  RawClient& operator=(const RawClient&) = delete;

  /// False once the other side has closed.
  bool Send(const std::string& bytes) const;
  /// Shuts down the sending direction.
  void Finish() const;
  /// All received bytes until the other side closes, or until nothing arrives for 5 s.
  std::string ReadAll() const;
  /// True if the other side closes within 3 s, which is less than the server's own timeouts. Data
  /// received before is dropped.
  bool Closed() const;

  /// Requests a WebSocket; true if it is granted.
  bool Upgrade(const std::string& path, const std::string& host, const std::string& origin);
  struct Message {
    int opcode = 0;
    std::string content;
  };
  /// Next message; none if nothing arrives for 5 s. Pings in between are answered.
  std::optional<Message> Next();
  /// Sends a masked frame; opcode 1 is text, 2 is binary.
  bool SendFrame(int opcode, const std::string& content) const;

 private:
  std::string ReadExactly(std::size_t size);

  int socket_ = -1;
  std::string read_;
};

/// Status of a response; 0 if there is none.
int StatusOf(const std::string& response);

}  // namespace torquer::test
