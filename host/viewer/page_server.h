// Serves the page by HTTP and exchanges messages with it by WebSocket, in one thread with one loop.
// Boost.Beast stays in page_server.cpp, because it takes long to compile.
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
/// It serves `/TOKEN/`, and below it the files of page_files.h and of Serve. A request's Host must
/// be this machine's loopback at the server's port, and its Origin, if present, the same. A
/// WebSocket at `/TOKEN/bus` needs an Origin. Each connection has one request.
class PageServer {
 public:
  /// Returns true if the message of a page is valid. A page that sends an invalid message is
  /// closed.
  using Received = std::function<bool(PageId page, std::span<const std::uint8_t> message)>;
  using Left = std::function<void(PageId page)>;

  /// Takes over the socket. `token` consists of letters and digits.
  PageServer(int listening_socket, const std::string& token, Received received, Left left);
  ~PageServer();
  PageServer(const PageServer&) = delete;
  PageServer& operator=(const PageServer&) = delete;

  /// URL that pages open: "http://127.0.0.1:PORT/TOKEN/".
  const std::string& url() const;

  /// Sends the newest message of a topic to all open and later pages. A slow page misses older
  /// messages of the topic, but never the newest.
  void ShowText(const std::string& topic, std::string text);
  void ShowBytes(const std::string& topic, std::string bytes);
  /// The same for a topic whose name another program chose. It is kept for a limited time
  /// (shown_topics.h).
  void ShowPassingText(const std::string& topic, std::string text);

  /// Forgets a topic: later pages do not get its last message.
  void Forget(const std::string& topic);

  /// Type of a file of Serve: a picture or a page. A page may contain styles, but no script and no
  /// request.
  enum class ServedAs { kPicture, kDocument };
  /// Sets a file below `/TOKEN/`, and replaces a file of that name. An empty file removes it.
  void Serve(const std::string& name, ServedAs as, std::string content);

  /// Calls `act` whenever `file_descriptor` is readable, but not more often than each `interval`.
  void WhenReadable(int file_descriptor, std::function<void()> act);
  void Every(std::chrono::milliseconds interval, std::function<void()> act);
  /// Runs until one of these functions calls Stop. Throws their exceptions.
  void Run();
  void Stop();

  /// Requests and messages that were refused, and connections beyond the limit.
  std::int64_t refused() const;
  int pages() const;

  static constexpr int kMostConnections = 40;  ///< requests and pages with the token
  static constexpr int kMostPages = 16;
  /// Most connections without the token. One more closes the oldest of them.
  static constexpr std::size_t kMostUnknown = 16;
  static constexpr std::size_t kMostHeaderBytes = 8192;
  /// A page that sends more messages, pings included, is closed with the reason.
  static constexpr int kMostMessagesPerS = 400;
  /// Largest number of bytes read from a connection; the rest waits at its sender.
  static constexpr std::size_t kMostReadBytesPerS = 32'768;

 private:
  class Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace torquer::viewer
