// A message of every type with every text and array filled, as bytes that its encoder made.
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
  /// What bus::DecodeMessage says of other bytes; where it decodes them, the message's encoder must
  /// make the same bytes again.
  std::function<bool(const Bytes&)> decodes;
};

/// Of every type in protocol/lcm that has a channel.
std::vector<SampleMessage> SampleMessages();

}  // namespace torquer::test
