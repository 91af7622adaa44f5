#include "host/bus/bus.h"

#include <arpa/inet.h>
#include <fmt/format.h>
#include <poll.h>
#include <sys/socket.h>
#include <unistd.h>

#include <algorithm>
#include <charconv>
#include <cstdlib>
#include <exception>
#include <fstream>
#include <iterator>
#include <string_view>
#include <system_error>
#include <utility>

#include "host/bus/clock.h"
#include "host/support/error.h"

namespace torquer::bus {
namespace {

constexpr char kFallbackUrl[] = "udpm://239.255.76.67:7667?ttl=0";
// Messages handled in one call: a limit, so that a flood of them cannot block the caller forever.
constexpr std::int64_t kBurst = 1000;
constexpr long kReceiveBufferBytes = 2 * 1024 * 1024;
constexpr std::int64_t kNoticeUs = 60'000'000;

[[noreturn]] void Refuse(const std::string& url, const std::string& problem) {
  throw UserError(
      fmt::format("LCM URL '{}': {}; give one like {} with --lcm-url or in LCM_DEFAULT_URL", url,
                  problem, kFallbackUrl));
}

bool ParseNumber(std::string_view text, long lowest, long highest, long& value) {
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), value);
  return error == std::errc() && end == text.data() + text.size() && value >= lowest &&
         value <= highest;
}

// LCM ignores options that it does not know and does not check numbers.
void ReadOptions(const std::string& url, std::string_view options, UdpmPlace& place) {
  while (!options.empty()) {
    const std::string_view option = options.substr(0, options.find('&'));
    options.remove_prefix(std::min(options.size(), option.size() + 1));
    const std::size_t equals = option.find('=');
    const std::string_view key = option.substr(0, equals);
    const std::string_view value =
        equals == std::string_view::npos ? std::string_view() : option.substr(equals + 1);
    long number = 0;
    if (key == "ttl") {
      if (!ParseNumber(value, 0, 255, number)) {
        Refuse(url, fmt::format("ttl '{}' is not a number from 0 to 255", value));
      }
      place.this_machine_only = number == 0;
    } else if (key == "recv_buf_size") {
      if (!ParseNumber(value, 1, 1L << 30, number)) {
        Refuse(url, fmt::format("recv_buf_size '{}' is not a number of bytes", value));
      }
      place.receive_buffer_bytes = static_cast<int>(number);
    } else {
      Refuse(url, fmt::format("unknown option '{}'", option));
    }
  }
}

// True if the kernel has a route to this multicast group. LCM's own message names the wrong one.
bool HasRoute(const sockaddr_in& group) {
  const int fd = socket(AF_INET, SOCK_DGRAM | SOCK_CLOEXEC, 0);
  if (fd < 0) return false;
  const bool routed = connect(fd, reinterpret_cast<const sockaddr*>(&group), sizeof group) == 0;
  close(fd);
  return routed;
}

// Asks for the largest receive buffer that the kernel grants: a burst of large messages overflows
// the usual 208 KiB.
int GrantedReceiveBuffer() {
  long granted = 0;
  std::ifstream("/proc/sys/net/core/rmem_max") >> granted;
  return static_cast<int>(std::clamp(granted, 0L, kReceiveBufferBytes));
}

UdpmPlace ReadMulticast(const std::string& url, std::string_view text) {
  const std::size_t question = text.find('?');
  const std::string_view options =
      question == std::string_view::npos ? std::string_view() : text.substr(question + 1);
  const std::string_view endpoint = text.substr(0, question);
  const std::size_t colon = endpoint.find(':');
  UdpmPlace place;
  ReadOptions(url, options, place);
  if (place.receive_buffer_bytes == 0) place.receive_buffer_bytes = GrantedReceiveBuffer();
  const std::string address(endpoint.substr(0, colon));
  sockaddr_in& group = place.group;
  group.sin_family = AF_INET;
  if (inet_pton(AF_INET, address.c_str(), &group.sin_addr) != 1 ||
      !IN_MULTICAST(ntohl(group.sin_addr.s_addr))) {
    Refuse(url, fmt::format("'{}' is not an IPv4 multicast address (224.0.0.0 and up)", address));
  }
  long port = 0;
  if (colon == std::string_view::npos || !ParseNumber(endpoint.substr(colon + 1), 1, 65535, port)) {
    Refuse(url, "no port from 1 to 65535 follows the address");
  }
  group.sin_port = htons(static_cast<std::uint16_t>(port));
  if (!HasRoute(group)) {
    throw UserError(fmt::format(
        "LCM URL '{}': this machine has no multicast route; run under host/bus/private_network, or "
        "as root: ip link set lo up multicast on; ip route add 224.0.0.0/4 dev lo",
        url));
  }
  return place;
}

// The multicast settings of `url`; nullopt for LCM's other transports.
std::optional<UdpmPlace> ReadUrl(const std::string& url) {
  const std::size_t scheme_end = url.find("://");
  if (scheme_end == std::string::npos) Refuse(url, "the URL has no scheme");
  const std::string scheme = url.substr(0, scheme_end);
  if (scheme == "udpm") {
    return ReadMulticast(url, std::string_view(url).substr(scheme_end + 3));
  }
  if (scheme != "tcpq" && scheme != "file" && scheme != "memq") {
    Refuse(url, fmt::format("unknown scheme '{}'", scheme));
  }
  return std::nullopt;
}

}  // namespace

std::string DefaultUrl() {
  const char* url = std::getenv("LCM_DEFAULT_URL");
  return url != nullptr && *url != '\0' ? url : kFallbackUrl;
}

struct Bus::Subscription {
  Bus* bus;
  ChannelCounters counters;
  RawHandler handler;

  void Take(const void* data, std::size_t size, const Arrival& arrival) {
    ++bus->handled_;
    try {
      if (handler(data, size, arrival)) {
        ++counters.received;
      } else {
        ++counters.undecodable;
        counters.undecodable_from = arrival.sender;
      }
    } catch (...) {  // liblcm is C: an exception must not cross it
      ++counters.received;
      bus->handler_error_ = std::current_exception();
    }
  }

  static void OnMessage(const lcm_recv_buf_t* buffer, const char* /*channel*/, void* self) {
    static_cast<Subscription*>(self)->Take(buffer->data, buffer->data_size,
                                           {Sender{}, MonotonicUs()});
  }
};

Bus::Bus(const std::string& url)
    : url_(url.empty() ? DefaultUrl() : url), lcm_(nullptr, &lcm_destroy), udpm_(ReadUrl(url_)) {
  lcm_.reset(lcm_create(url_.c_str()));
  if (lcm_ == nullptr) Refuse(url_, "LCM cannot open it");
}

Bus::~Bus() = default;

Bus::Buffer& Bus::ThreadBuffer() {
  thread_local Buffer buffer;
  return buffer;
}

bool Bus::Send(const std::string& channel, const Buffer& buffer) {
  const int status = lcm_publish(lcm_.get(), channel.c_str(), buffer.data(),
                                 static_cast<unsigned int>(buffer.size()));
  if (status != 0) ++publish_failures_;
  return status == 0;
}

UdpmReceiver& Bus::Receiver() {
  if (receiver_ == nullptr) {
    try {
      receiver_ = std::make_unique<UdpmReceiver>(*udpm_);
    } catch (const std::system_error& error) {
      throw UserError(
          fmt::format("LCM URL '{}': cannot listen ({}); check if another program uses the port",
                      url_, error.what()));
    }
  }
  return *receiver_;
}

void Bus::AddSubscription(const std::string& channel, int queue, RawHandler handler) {
  Subscription& subscription = subscriptions_.emplace_back();
  subscription.bus = this;
  subscription.counters.channel = channel;
  subscription.handler = std::move(handler);
  if (udpm_) {
    Receiver().Listen(channel, queue);
    return;
  }
  lcm_subscription_t* made =
      lcm_subscribe(lcm_.get(), channel.c_str(), &Subscription::OnMessage, &subscription);
  if (made == nullptr || FileDescriptor() < 0) {
    throw UserError(fmt::format("LCM URL '{}': cannot listen on channel {}", url_, channel));
  }
  lcm_subscription_set_queue_capacity(made, queue);
}

int Bus::Handle(int timeout_ms) {
  handled_ = 0;
  if (udpm_) {
    HandleReceived(timeout_ms);
  } else {
    int ready = lcm_handle_timeout(lcm_.get(), timeout_ms);
    while (ready > 0 && handled_ < kBurst && handler_error_ == nullptr) {
      ready = lcm_handle_timeout(lcm_.get(), 0);
    }
  }
  if (handler_error_ != nullptr) std::rethrow_exception(std::exchange(handler_error_, nullptr));
  return static_cast<int>(handled_);
}

void Bus::HandleUntil(std::int64_t end_us, const std::function<bool()>& done) {
  do {
    const std::int64_t left_us = std::max<std::int64_t>(end_us - MonotonicUs(), 0);
    Handle(static_cast<int>((left_us + 999) / 1000));
  } while (!done() && MonotonicUs() < end_us);
}

void Bus::HandleReceived(int timeout_ms) {
  pollfd waiting{FileDescriptor(), POLLIN, 0};
  if (poll(&waiting, 1, timeout_ms) <= 0) return;
  while (handled_ < kBurst && handler_error_ == nullptr) {
    const std::optional<UdpmReceiver::Received> received = receiver_->Next();
    if (!received) return;
    const auto subscription =
        std::next(subscriptions_.begin(), static_cast<std::ptrdiff_t>(received->subscription));
    subscription->Take(received->data.data(), received->data.size(), received->arrival);
  }
}

int Bus::FileDescriptor() {
  return udpm_ ? Receiver().FileDescriptor() : lcm_get_fileno(lcm_.get());
}

std::string Bus::TakeNotice(std::int64_t now_us) {
  if (notice_us_ != 0 && now_us - notice_us_ < kNoticeUs) return "";
  std::string notice;
  const auto add = [&](std::int64_t count, std::int64_t& noted, const std::string& what) {
    if (count > noted)
      notice += fmt::format("{}{} {}", notice.empty() ? "" : "; ", count - noted, what);
    noted = count;
  };
  noted_undecodable_.resize(subscriptions_.size());
  std::size_t k = 0;
  for (const Subscription& subscription : subscriptions_) {
    const ChannelCounters& counters = subscription.counters;
    add(counters.undecodable, noted_undecodable_[k++],
        fmt::format("invalid messages on {}, the last from {}", counters.channel,
                    Describe(counters.undecodable_from)));
  }
  if (receiver_ != nullptr) {
    const UdpmReceiver::Damaged damaged = receiver_->damaged();
    add(damaged.count, noted_damaged_,
        fmt::format("damaged datagrams, the last from {}", Describe(damaged.last_sender)));
  }
  add(dropped(), noted_dropped_, "messages dropped, because they arrived too fast");
  if (notice.empty()) return "";
  notice_us_ = now_us;
  return "refused on the bus: " + notice;
}

std::vector<ChannelCounters> Bus::counters() const {
  std::vector<ChannelCounters> all;
  for (const Subscription& subscription : subscriptions_) all.push_back(subscription.counters);
  return all;
}

std::int64_t Bus::undecodable() const {
  std::int64_t sum = receiver_ == nullptr ? 0 : receiver_->damaged().count;
  for (const Subscription& subscription : subscriptions_) sum += subscription.counters.undecodable;
  return sum;
}

std::int64_t Bus::dropped() const {
  std::int64_t sum = 0;
  for (std::size_t k = 0; receiver_ != nullptr && k < subscriptions_.size(); ++k) {
    sum += receiver_->dropped(k);
  }
  return sum;
}

}  // namespace torquer::bus
