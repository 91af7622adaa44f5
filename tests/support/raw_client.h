// A client that sends what it likes: bytes over TCP, with as much of HTTP and WebSocket as tests
// need.
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

namespace torquer::test {

class RawClient {
 public:
  /// Connects to 127.0.0.1. receive_buffer_bytes: the kernel's, 0 its default.
  explicit RawClient(std::uint16_t port, int receive_buffer_bytes = 0);
  ~RawClient();
  RawClient(const RawClient&) = delete;
  RawClient& operator=(const RawClient&) = delete;

  /// False when the other side has closed.
  bool Send(const std::string& bytes) const;
  /// Says that nothing more will be sent.
  void Finish() const;
  /// What comes until the other side closes, or nothing has come for 5 s.
  std::string ReadAll() const;
  /// True when the other side closes within 3 s, before any of the server's own time limits; what
  /// comes before is dropped.
  bool Closed() const;

  /// Asks for a WebSocket; true when it is granted.
  bool Upgrade(const std::string& path, const std::string& host, const std::string& origin);
  struct Message {
    int opcode = 0;
    std::string content;
  };
  /// The next message; nothing when there is none for 5 s. Pings on the way are answered.
  std::optional<Message> Next();
  /// A masked frame; 1 text, 2 binary.
  bool SendFrame(int opcode, const std::string& content) const;

 private:
  std::string ReadExactly(std::size_t size);

  int socket_ = -1;
  std::string read_;
};

/// The status of a response; 0 where there is none.
int StatusOf(const std::string& response);

}  // namespace torquer::test
