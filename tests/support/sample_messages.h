// Sample messages of every type, with every text and array filled, as encoded bytes.
#pragma once

#include <cstdint>
#include <functional>
#include <string>
#include <vector>

namespace torquer::test {

using Bytes = std::vector<std::uint8_t>;

struct SampleMessage {
  std::string type;
  Bytes bytes;
  /// Result of bus::DecodeMessage for other bytes. If it decodes them, the encoder must reproduce
  /// the same bytes.
  std::function<bool(const Bytes&)> decodes;
};

/// One message of every type in protocol/lcm that has a channel.
std::vector<SampleMessage> SampleMessages();

}  // namespace torquer::test
