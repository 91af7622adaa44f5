// Log of wire states and other messages, written as torquer-recorder writes it.
#pragma once

#include <cstdint>
#include <lcm/lcm-cpp.hpp>
#include <stdexcept>
#include <string>
#include <torquer_lcm/wire_state_t.hpp>
#include <vector>

#include "protocol/lcm_channels.h"

namespace torquer::test {

class StateLog {
 public:
  explicit StateLog(const std::string& path) : file_(path, "w") {
    if (!file_.good()) throw std::runtime_error("cannot write " + path);
  }

  void Write(const torquer_lcm::wire_state_t& state) { Write(protocol::kWireStateChannel, state); }
  template <class Message>
  void Write(const char* channel, const Message& message) {
    std::vector<std::uint8_t> bytes(static_cast<std::size_t>(message.getEncodedSize()));
    message.encode(bytes.data(), 0, static_cast<int>(bytes.size()));
    lcm::LogEvent event;
    event.eventnum = event.timestamp = count_++;
    event.channel = channel;
    event.datalen = static_cast<int>(bytes.size());
    event.data = bytes.data();
    file_.writeEvent(&event);
  }

 private:
  lcm::LogFile file_;
  std::int64_t count_ = 0;
};

}  // namespace torquer::test
