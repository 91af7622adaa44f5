// Message bus: LCM with error reporting.
//
// LCM itself reports neither a bad URL nor a message that it cannot decode. Its receiver trusts the
// received bytes. This class handles all three. Channel names: protocol/lcm_channels.h.
#pragma once

#include <lcm/lcm.h>

#include <atomic>
#include <cstddef>
#include <cstdint>
#include <exception>
#include <functional>
#include <list>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "host/bus/message_check.h"
#include "host/bus/sender.h"
#include "host/bus/udpm_receiver.h"

namespace torquer::bus {

/// Counters of one subscription.
struct ChannelCounters {
  std::string channel;
  std::int64_t received = 0;     ///< decoded, and passed to the handler
  std::int64_t undecodable = 0;  ///< not a message of the type (message_check.h); dropped
  Sender undecodable_from;       ///< sender of the last undecodable message
};

/// The URL in use when the user gives none: $LCM_DEFAULT_URL, else multicast with ttl 0. With that
/// ttl no message leaves this machine, and none from another machine is received.
std::string DefaultUrl();

/// One connection to the bus. Not copyable. Publish() may be called from any thread, everything
/// else from one thread at a time.
class Bus {
 public:
  /// Connects to `url`; "" means DefaultUrl().
  /// Throws UserError naming the URL and the remedy when it is malformed or unreachable.
  explicit Bus(const std::string& url = "");
  ~Bus();
  Bus(const Bus&) = delete;
  Bus& operator=(const Bus&) = delete;

  const std::string& url() const { return url_; }

  /// Sends `message`; false when the network refused it (counted in publish_failures()).
  template <class Message>
  bool Publish(const std::string& channel, const Message& message) {
    const int size = message.getEncodedSize();
    Buffer& buffer = ThreadBuffer();
    buffer.resize(static_cast<std::size_t>(size));
    message.encode(buffer.data(), 0, size);
    return Send(channel, buffer);
  }

  /// Calls `handler` from Handle() for every message that decodes as Message; counts the others.
  /// The handler's exceptions reach the caller of Handle(). At most `queue` messages wait; beyond
  /// that the newest is dropped, not the oldest. 0: as many as fit into the memory that messages of
  /// all channels may take (UdpmReceiver::kMostWaitingBytes).
  /// Throws UserError when the bus cannot be listened to.
  template <class Message>
  void Subscribe(const std::string& channel, std::function<void(const Message&)> handler,
                 int queue = 30) {
    SubscribeWithArrival<Message>(
        channel,
        [handler = std::move(handler)](const Message& message, const Arrival&) {
          handler(message);
        },
        queue);
  }
  /// Like Subscribe(), but the handler also gets the message's sender and arrival time.
  template <class Message>
  void SubscribeWithArrival(const std::string& channel,
                            std::function<void(const Message&, const Arrival&)> handler,
                            int queue = 30) {
    AddSubscription(
        channel, queue,
        [handler = std::move(handler)](const void* data, std::size_t size, const Arrival& arrival) {
          Message message;
          if (!DecodeMessage(data, size, message)) return false;
          handler(message, arrival);
          return true;
        });
  }

  /// Calls `handler` with the bytes of every message on `channel`, decodable or not. The queue is
  /// limited only by UdpmReceiver::kMostWaitingBytes.
  void SubscribeBytes(
      const std::string& channel,
      std::function<void(std::span<const std::uint8_t> data, const Arrival&)> handler) {
    AddSubscription(
        channel, 0,
        [handler = std::move(handler)](const void* data, std::size_t size, const Arrival& arrival) {
          handler({static_cast<const std::uint8_t*>(data), size}, arrival);
          return true;
        });
  }

  /// Handles the queued messages, after waiting at most `timeout_ms` for the first one. Returns the
  /// number handled, undecodable ones included.
  int Handle(int timeout_ms);
  /// Handles messages until `done` returns true or MonotonicUs() reaches `end_us`. Messages already
  /// queued are handled in any case.
  void HandleUntil(std::int64_t end_us, const std::function<bool()>& done);

  /// Descriptor for poll(): readable when a message is queued. Starts the receiving thread.
  int FileDescriptor();

  /// A sentence about messages refused or dropped since the last notice, with channels, counts and
  /// senders. Empty without news, or less than a minute after the last notice. `now_us` by
  /// MonotonicUs().
  std::string TakeNotice(std::int64_t now_us);

  /// One entry per subscription, in the order of Subscribe().
  std::vector<ChannelCounters> counters() const;
  std::int64_t undecodable()
      const;                     ///< sum over all subscriptions, plus datagrams that are not LCM's
  std::int64_t dropped() const;  ///< because a queue was full; sum over all subscriptions
  std::int64_t publish_failures() const { return publish_failures_; }

 private:
  using Buffer = std::vector<std::uint8_t>;
  /// True when the bytes were a message of the subscribed type.
  using RawHandler =
      std::function<bool(const void* data, std::size_t size, const Arrival& arrival)>;
  struct Subscription;

  static Buffer& ThreadBuffer();
  bool Send(const std::string& channel, const Buffer& buffer);
  void AddSubscription(const std::string& channel, int queue, RawHandler handler);
  UdpmReceiver& Receiver();
  void HandleReceived(int timeout_ms);

  std::string url_;
  std::unique_ptr<lcm_t, void (*)(lcm_t*)> lcm_;
  std::optional<UdpmPlace> udpm_;  // set for UDP multicast, where liblcm only sends
  std::unique_ptr<UdpmReceiver> receiver_;
  std::list<Subscription> subscriptions_;
  std::int64_t handled_ = 0;
  std::exception_ptr handler_error_;
  std::int64_t notice_us_ = 0;  // 0: none yet
  // Counts already reported in notices.
  std::vector<std::int64_t> noted_undecodable_;
  std::int64_t noted_damaged_ = 0;
  std::int64_t noted_dropped_ = 0;
  std::atomic<std::int64_t> publish_failures_ = 0;
};

}  // namespace torquer::bus
