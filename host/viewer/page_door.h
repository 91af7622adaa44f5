// Admission of connections, limits on the messages of a page, and the reason when it is closed. No
// I/O, no clock.
#pragma once

#include <chrono>
#include <cstddef>
#include <string>
#include <string_view>
#include <vector>

namespace torquer::viewer {

/// Content security policies of the page, and of a document from another program, which may not
/// load any file.
inline constexpr char kPagePolicy[] =
    "default-src 'none'; script-src 'self'; style-src 'self'; img-src 'self' blob:; "
    "connect-src 'self'; frame-src 'self'; frame-ancestors 'none'; base-uri 'none'; "
    "form-action 'none'";
inline constexpr char kDocumentPolicy[] =
    "default-src 'none'; style-src 'unsafe-inline'; img-src data:; frame-ancestors 'self'; "
    "base-uri 'none'; form-action 'none'; sandbox";

/// A request as it describes itself.
struct Visitor {
  std::string_view method;
  std::string_view target;
  std::size_t hosts = 0;  ///< how often it names one
  std::string_view host;
  std::size_t origins = 0;
  std::string_view origin;
  bool upgrade = false;  ///< it asks for a WebSocket
};

/// Admits requests with the token whose Host is this machine's loopback and whose Origin is this
/// server.
struct Door {
  std::string token;
  std::vector<std::string> hosts;  ///< that are this server

  struct Answer {
    unsigned status = 200;  ///< of HTTP
    std::string name;       ///< requested path below the token's folder
  };
  Answer Open(const Visitor& visitor) const;
};

/// Counts the messages of a page per second.
class MessageRate {
 public:
  /// True if one more message is within `most` per second.
  bool Take(int most, std::chrono::steady_clock::time_point now);

 private:
  std::chrono::steady_clock::time_point since_{};
  int messages_ = 0;
};

/// Last frame of the WebSocket for a page that broke a rule, with the rule in at most 100 letters.
std::string CloseFrame(std::string_view reason);

}  // namespace torquer::viewer
