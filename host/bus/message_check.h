// Whether bytes are a message, before the decoder that lcm-gen made sees them: it trusts the
// lengths and counts in a message, throws on some, and asks for any amount of memory on others.
#pragma once

#include <cstddef>
#include <cstdint>
#include <new>
#include <span>
#include <string_view>

namespace torquer::bus {

/// Whether `bytes` are exactly one message of the type `type_name` of protocol/lcm: `fingerprint`
/// first, every text and array whole, texts with one zero byte and at their end, no count below
/// zero or above the number of bytes, and nothing left over. Reads no byte outside, allocates
/// nothing, and takes a time proportional to the bytes, whatever is in them.
/// Throws std::logic_error for a type that protocol/lcm does not define.
bool IsMessage(std::string_view type_name, std::int64_t fingerprint,
               std::span<const std::uint8_t> bytes);

/// Decodes `size` bytes at `data` as a Message of protocol/lcm; false where they are none, and
/// `message` has no meaning then. Never throws. For bytes of any origin: the bus, a log.
// Not inlined: GCC 12 then warns of the generated decoder, and wrongly.
template <class Message>
[[gnu::noinline]] bool DecodeMessage(const void* data, std::size_t size, Message& message) {
  const auto* bytes = static_cast<const std::uint8_t*>(data);
  if (!IsMessage(Message::getTypeName(), Message::getHash(), {bytes, size})) return false;
  try {
    return message.decode(data, 0, static_cast<int>(size)) == static_cast<int>(size);
  } catch (const std::bad_alloc&) {
    return false;
  }
}

}  // namespace torquer::bus
