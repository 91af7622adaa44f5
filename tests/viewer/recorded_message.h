// Messages in the log of a made session.
#pragma once

#include <cstdint>
#include <vector>

#include "host/support/event_log_writer.h"

namespace torquer::test {

/// When the sessions of these tests begin.
inline constexpr std::int64_t kBeginUs = 1'700'000'000'000'000;

/// Writes a message that came `at_us` after the begin.
template <class Message>
void Write(EventLogWriter& log, std::int64_t at_us, const char* channel, const Message& message) {
  std::vector<std::uint8_t> bytes(static_cast<std::size_t>(message.getEncodedSize()));
  message.encode(bytes.data(), 0, static_cast<int>(bytes.size()));
  log.Write(kBeginUs + at_us, channel, bytes);
}

}  // namespace torquer::test
