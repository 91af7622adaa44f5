// A page that steers, for tests of what torquer-viewer sends to the bus.
#pragma once

#include <atomic>
#include <catch2/catch.hpp>
#include <chrono>
#include <cstdint>
#include <cstring>
#include <optional>
#include <string>
#include <thread>

#include "host/viewer/page_messages.h"
#include "tests/support/raw_client.h"

namespace torquer::test {

/// Page that steers: for its lifetime it pushes the wire at 5 mm/s and holds pedals.
class SteeringPage {
 public:
  static constexpr int kXray = 1, kAcquisition = 4;

  /// `printed`: output of torquer-viewer with the page's link. `pedals`: kXray, kAcquisition or 0.
  SteeringPage(const std::string& printed, int pedals) : pedals_(pedals) {
    const std::string link = printed.substr(printed.find("http://"));
    const std::size_t host = link.find("127.0.0.1:");
    const std::size_t path = link.find('/', host);
    const std::string name = link.substr(host, path - host);
    client_.emplace(static_cast<std::uint16_t>(std::stoi(name.substr(name.find(':') + 1))));
    const std::string token = link.substr(path + 1, link.find_first_of("/\n", path + 1) - path - 1);
    REQUIRE(client_->Upgrade("/" + token + "/bus", name, "http://" + name));
    thread_ = std::thread([this] { Run(); });
  }
  ~SteeringPage() {
    stop_ = true;
    thread_.join();
  }
  SteeringPage(const SteeringPage&) = delete;
  SteeringPage& operator=(const SteeringPage&) = delete;

  void Hold(int pedals) { pedals_ = pedals; }

 private:
  void Run() {
    std::string controls(viewer::kControlsBytes, '\0');
    const float push_mm_s = 5;
    controls[0] = static_cast<char>(viewer::FrameKind::kControls);
    controls[1] = static_cast<char>(viewer::kFrameVersion);
    std::memcpy(controls.data() + 4, &push_mm_s, sizeof push_mm_s);
    do {
      controls[2] = static_cast<char>(pedals_.load());
      std::this_thread::sleep_for(std::chrono::milliseconds(50));
    } while (!stop_ && client_->SendFrame(2, controls));
  }

  std::optional<RawClient> client_;
  std::atomic<int> pedals_;
  std::atomic<bool> stop_ = false;
  std::thread thread_;
};

}  // namespace torquer::test
