// Messages for the log of an artificial session.
#pragma once

#include <cstdint>
#include <vector>

#include "host/support/event_log_writer.h"

namespace torquer::test {

/// Start time of the sessions in these tests.
inline constexpr std::int64_t kBeginUs = 1'700'000'000'000'000;

/// Writes a message that arrived `at_us` after the start.
template <class Message>
void Write(EventLogWriter& log, std::int64_t at_us, const char* channel, const Message& message) {
  std::vector<std::uint8_t> bytes(static_cast<std::size_t>(message.getEncodedSize()));
  message.encode(bytes.data(), 0, static_cast<int>(bytes.size()));
  log.Write(kBeginUs + at_us, channel, bytes);
}

}  // namespace torquer::test
