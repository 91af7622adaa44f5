// Page server in its own thread, for tests that act as its clients.
#pragma once

#include <atomic>
#include <chrono>
#include <cstdint>
#include <functional>
#include <span>
#include <string>
#include <thread>

#include "host/viewer/listening_socket.h"
#include "host/viewer/page_server.h"
#include "tests/support/raw_client.h"

namespace torquer::test {

inline const std::string kToken = "0123456789abcdef0123456789abcdef";

/// Accepts messages of four bytes. Its thread calls `beat` every millisecond.
class Served {
 public:
  explicit Served(const std::function<void(viewer::PageServer&)>& beat = {})
      : listening_(viewer::ListeningSocket(0)),
        port(viewer::PortOf(listening_)),
        host("127.0.0.1:" + std::to_string(port)),
        server_(
            listening_, kToken,
            [this](viewer::PageId, std::span<const std::uint8_t> message) {
              ++received;
              return message.size() == 4;
            },
            [this](viewer::PageId) { ++left; }) {
    server_.Every(std::chrono::milliseconds(1), [this, beat] {
      if (stop_) server_.Stop();
      if (beat) beat(server_);
      refused = server_.refused();
      pages = server_.pages();
    });
    thread_ = std::thread([this] { server_.Run(); });
  }
  ~Served() {
    stop_ = true;
    thread_.join();
  }
  Served(const Served&) = delete;
  Served& operator=(const Served&) = delete;

  int Get(const std::string& target, const std::string& more = "") const {
    const RawClient client(port);
    client.Send("GET " + target + " HTTP/1.1\r\nHost: " + host + "\r\n" + more + "\r\n");
    return StatusOf(client.ReadAll());
  }
  std::string Bus() const { return "/" + kToken + "/bus"; }
  std::string Origin() const { return "http://" + host; }
  template <class Condition>
  static bool Soon(Condition condition) {
    for (int i = 0; i < 5000 && !condition(); ++i) {
      std::this_thread::sleep_for(std::chrono::milliseconds(1));
    }
    return condition();
  }

 private:
  int listening_;
  std::atomic<bool> stop_ = false;

 public:
  std::uint16_t port;
  std::string host;
  std::atomic<int> received = 0;
  std::atomic<int> left = 0;
  std::atomic<std::int64_t> refused = 0;
  std::atomic<int> pages = 0;

 private:
  viewer::PageServer server_;
  std::thread thread_;
};

}  // namespace torquer::test
