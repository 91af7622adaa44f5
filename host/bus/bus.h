// LCM with errors that are reported.
//
// LCM itself reports neither a bad URL nor a message that it cannot decode; both are checked here.
// Channel names: protocol/lcm_channels.h.
#pragma once

#include <lcm/lcm.h>

#include <atomic>
#include <cstddef>
#include <cstdint>
#include <exception>
#include <functional>
#include <list>
#include <memory>
#include <string>
#include <vector>

namespace torquer::bus {

/// What a subscription has received.
struct ChannelCounters {
  std::string channel;
  std::int64_t received = 0;     ///< decoded, and passed to the handler
  std::int64_t undecodable = 0;  ///< of another type, too short, or too long; dropped
};

/// The URL in use when the user gives none: $LCM_DEFAULT_URL, else multicast that stays on this
/// machine (ttl 0).
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
  /// The handler's exceptions reach the caller of Handle(). At most `queue` messages wait (30 is
  /// LCM's default); beyond that LCM drops the newest, not the oldest. 0 means no limit.
  /// Throws UserError when the bus cannot be listened to.
  template <class Message>
  void Subscribe(const std::string& channel, std::function<void(const Message&)> handler,
                 int queue = 30) {
    AddSubscription(channel, queue, [handler = std::move(handler)](const void* data, int size) {
      Message message;
      if (message.decode(data, 0, size) != size) return false;
      handler(message);
      return true;
    });
  }

  /// Handles the messages that wait, after waiting at most `timeout_ms` for the first one.
  /// Returns the number handled, undecodable ones included.
  int Handle(int timeout_ms);

  /// Readable when a message waits; for poll(). Starts LCM's receiving thread.
  int FileDescriptor();

  /// One entry per subscription, in the order of Subscribe().
  std::vector<ChannelCounters> counters() const;
  std::int64_t undecodable() const;  ///< over all subscriptions
  std::int64_t publish_failures() const { return publish_failures_; }

 private:
  using Buffer = std::vector<std::uint8_t>;
  /// True when the bytes were a message of the subscribed type.
  using RawHandler = std::function<bool(const void* data, int size)>;
  struct Subscription;

  static Buffer& ThreadBuffer();
  bool Send(const std::string& channel, const Buffer& buffer);
  void AddSubscription(const std::string& channel, int queue, RawHandler handler);

  std::string url_;
  std::unique_ptr<lcm_t, void (*)(lcm_t*)> lcm_;
  std::list<Subscription> subscriptions_;
  std::int64_t handled_ = 0;
  std::exception_ptr handler_error_;
  std::atomic<std::int64_t> publish_failures_ = 0;
};

}  // namespace torquer::bus
