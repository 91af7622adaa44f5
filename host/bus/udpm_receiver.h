// Receiver of a bus on UDP multicast, compatible with LCM; liblcm does the sending.
#pragma once

#include <netinet/in.h>

#include <cstdint>
#include <deque>
#include <mutex>
#include <optional>
#include <string>
#include <thread>
#include <vector>

#include "host/bus/sender.h"
#include "host/bus/udpm_datagram.h"

namespace torquer::bus {

/// Multicast group and socket options.
struct UdpmPlace {
  sockaddr_in group{};
  /// Refuse datagrams from other machines, also with a false source address.
  bool this_machine_only = true;
  int receive_buffer_bytes = 0;  ///< 0: the kernel's default
};

/// Receives in its own thread, which empties the kernel's buffer while the program computes.
class UdpmReceiver {
 public:
  /// Throws std::system_error with the step that failed.
  explicit UdpmReceiver(const UdpmPlace& place);
  ~UdpmReceiver();
  UdpmReceiver(const UdpmReceiver&) = delete;
  UdpmReceiver& operator=(const UdpmReceiver&) = delete;

  /// Keeps messages of `channel` from now on, at most `most_waiting` at a time. With 0 it keeps as
  /// many as fit into kMostWaitingBytes with all others. Beyond that the newest is dropped. Returns
  /// the index of the subscription: 0, 1, 2..
  std::size_t Listen(const std::string& channel, int most_waiting);

  struct Received {
    std::size_t subscription = 0;
    Arrival arrival;
    std::vector<std::uint8_t> data;
  };
  /// The oldest message that waits, if any.
  std::optional<Received> Next();

  /// Readable while a message is queued.
  int FileDescriptor() const { return waiting_fd_; }

  /// Count of datagrams that were not part of any LCM message, and the sender of the last.
  struct Damaged {
    std::int64_t count = 0;
    Sender last_sender;
  };
  Damaged damaged() const;
  /// Number of messages dropped because the queue of a subscription was full.
  std::int64_t dropped(std::size_t subscription) const;

  /// Memory limit of all queues in bytes: some seconds of the largest states.
  static constexpr std::size_t kMostWaitingBytes = std::size_t{64} << 20;

 private:
  struct Subscription {
    std::string channel;
    int most_waiting = 0;
    int waiting = 0;
    std::int64_t dropped = 0;
  };

  void Open(const UdpmPlace& place);
  void Close();
  void Run();
  void TakeDatagrams();
  void Add(const UdpmAssembly::Message& message, const Sender& sender);

  int socket_ = -1;
  int stop_fd_ = -1;
  int waiting_fd_ = -1;
  std::vector<std::uint8_t> buffer_;
  UdpmAssembly assembly_;

  mutable std::mutex mutex_;  // guards the members below, up to thread_
  std::vector<Subscription> subscriptions_;
  std::deque<Received> waiting_;
  std::size_t waiting_bytes_ = 0;
  Damaged damaged_;

  std::thread thread_;
};

}  // namespace torquer::bus
