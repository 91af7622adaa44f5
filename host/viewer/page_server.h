// Serves the page and talks with it: HTTP and WebSocket, one thread, one loop. Boost.Beast stays in
// page_server.cpp, because it takes long to compile.
#pragma once

#include <chrono>
#include <cstdint>
#include <functional>
#include <memory>
#include <span>
#include <string>

#include "host/viewer/page_id.h"

namespace torquer::viewer {

/// Server of the page and its WebSocket, with checks of path, host and origin.
///
/// Served is `/TOKEN/`, the few files of page_files.h and those of Serve below it, to requests
/// whose Host is this machine's loopback at the server's port, and whose Origin, where there is
/// one, is the same. A WebSocket at `/TOKEN/bus` needs an Origin. One request a connection.
class PageServer {
 public:
  /// Returns true if the message of a page is valid; a page that sends an invalid one is cut off.
  using Received = std::function<bool(PageId page, std::span<const std::uint8_t> message)>;
  using Left = std::function<void(PageId page)>;

  /// Takes over the socket. `token` consists of letters and digits.
  PageServer(int listening_socket, const std::string& token, Received received, Left left);
  ~PageServer();
  PageServer(const PageServer&) = delete;
  PageServer& operator=(const PageServer&) = delete;

  /// URL that pages open: "http://127.0.0.1:PORT/TOKEN/".
  const std::string& url() const;

  /// The newest of a topic, to all pages, and to those that come later. A page that is slow misses
  /// older ones of the same topic, never the newest.
  void ShowText(const std::string& topic, std::string text);
  void ShowBytes(const std::string& topic, std::string bytes);
  /// The same of a topic whose name others chose, which has a place for a time (shown_topics.h).
  void ShowPassingText(const std::string& topic, std::string text);

  /// Pages that come later do not get what was shown of this topic.
  void Forget(const std::string& topic);

  /// Type of a file of Serve: a picture, or a whole page. A page may contain a style and nothing
  /// else: no script, no request.
  enum class ServedAs { kPicture, kDocument };
  /// A file below `/TOKEN/`, in place of one of that name; an empty one ends it.
  void Serve(const std::string& name, ServedAs as, std::string content);

  /// Calls `act` whenever `file_descriptor` is readable; as often as `interval` allows.
  void WhenReadable(int file_descriptor, std::function<void()> act);
  void Every(std::chrono::milliseconds interval, std::function<void()> act);
  /// Until Stop, which is called from one of those. Their exceptions come out here.
  void Run();
  void Stop();

  /// Requests and messages that were refused, and connections beyond the limit.
  std::int64_t refused() const;
  int pages() const;

  static constexpr int kMostConnections = 40;  ///< requests and pages that know the token
  static constexpr int kMostPages = 16;
  /// Connections that have not shown the token; one more, and the oldest of them is closed.
  static constexpr std::size_t kMostUnknown = 16;
  static constexpr std::size_t kMostHeaderBytes = 8192;
  /// A page that sends more of them, pings included, is cut off with the reason.
  static constexpr int kMostMessagesPerS = 400;
  /// Bytes read of a connection; the rest waits at its sender.
  static constexpr std::size_t kMostReadBytesPerS = 32'768;

 private:
  class Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace torquer::viewer
