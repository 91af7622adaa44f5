// Message check: run before the decoder that lcm-gen generates. That decoder trusts the lengths and
// counts in a message. It throws on some, and allocates any amount of memory on others.
#pragma once

#include <cstddef>
#include <cstdint>
#include <new>
#include <span>
#include <string_view>
#include <type_traits>

#include "host/bus/event_times.h"

namespace torquer::bus {

/// True if `bytes` are exactly one message of the type `type_name` of protocol/lcm. It must start
/// with `fingerprint`, and every text and array must be complete. Each text has one zero byte, at
/// its end. No count is negative or above the number of bytes, and no bytes are left over. For any
/// content, it reads only within `bytes`, does not allocate, and takes time proportional to their
/// number. Throws std::logic_error for a type that protocol/lcm does not define.
bool IsMessage(std::string_view type_name, std::int64_t fingerprint,
               std::span<const std::uint8_t> bytes);

/// Decodes `size` bytes at `data` as a Message of protocol/lcm. Returns false if they are not one;
/// then `message` has no meaning. Never throws. Accepts bytes from any origin, such as the bus or a
/// log. Readings of earlier releases get the meaning of the present ones.
// Not inlined: otherwise GCC 12 wrongly warns about the generated decoder.
template <class Message>
[[gnu::noinline]] bool DecodeMessage(const void* data, std::size_t size, Message& message) {
  const auto* bytes = static_cast<const std::uint8_t*>(data);
  if (!IsMessage(Message::getTypeName(), Message::getHash(), {bytes, size})) return false;
  try {
    if (message.decode(data, 0, static_cast<int>(size)) != static_cast<int>(size)) return false;
  } catch (const std::bad_alloc&) {
    return false;
  }
  if constexpr (std::is_same_v<Message, torquer_lcm::readings_t>) ForgetNegativeEventTimes(message);
  return true;
}

}  // namespace torquer::bus
