// LCM's datagrams on UDP multicast ("udpm"): small messages whole in one, large ones in fragments.
#pragma once

#include <cstddef>
#include <cstdint>
#include <list>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "host/bus/sender.h"

namespace torquer::bus {

/// Assembles messages from datagrams of any origin. The code of liblcm 1.3.1 adds a fragment's
/// offset and size in 32 bits. So two datagrams can make it write anywhere.
class UdpmAssembly {
 public:
  /// Views into the datagram or this object, until the next Take().
  struct Message {
    std::string_view channel;
    std::span<const std::uint8_t> data;
  };
  enum class Outcome {
    kMessage,   ///< a message is complete
    kFragment,  ///< a fragment of one was taken
    kRefused,   ///< damaged, too large, or a fragment that does not follow the one before
  };

  Outcome Take(std::span<const std::uint8_t> datagram, const Sender& sender, Message& message);

  /// Largest assembled message, bytes; the largest message of Torquer is a tenth of it.
  static constexpr std::size_t kLargestMessage = std::size_t{4} << 20;
  /// Most messages assembled at a time; one more discards the oldest.
  static constexpr std::size_t kMostAssemblies = 8;

 private:
  // Fragments must arrive in order, as they are sent; out of order, the message is lost.
  struct Assembly {
    Sender sender;
    std::uint32_t number = 0;
    std::size_t size = 0;
    std::uint32_t fragments = 0;
    std::uint32_t taken = 0;
    std::string channel;
    std::vector<std::uint8_t> data;
  };

  Outcome TakeFragment(std::span<const std::uint8_t> datagram, const Sender& sender,
                       Message& message);

  std::list<Assembly> assemblies_;  // oldest first
  Assembly done_;
};

}  // namespace torquer::bus
