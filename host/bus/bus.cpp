#include "host/bus/bus.h"

#include <arpa/inet.h>
#include <fmt/format.h>
#include <sys/socket.h>
#include <unistd.h>

#include <algorithm>
#include <charconv>
#include <cstdlib>
#include <exception>
#include <fstream>
#include <string_view>
#include <utility>

#include "host/support/error.h"

namespace torquer::bus {
namespace {

constexpr char kFallbackUrl[] = "udpm://239.255.76.67:7667?ttl=0";
// Messages handled in one call, so that a flood of them cannot hold the caller for ever.
constexpr std::int64_t kBurst = 1000;
constexpr long kReceiveBufferBytes = 2 * 1024 * 1024;

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
void CheckOptions(const std::string& url, std::string_view options) {
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
    } else if (key == "recv_buf_size") {
      if (!ParseNumber(value, 1, 1L << 30, number)) {
        Refuse(url, fmt::format("recv_buf_size '{}' is not a number of bytes", value));
      }
    } else {
      Refuse(url, fmt::format("unknown option '{}'", option));
    }
  }
}

// Whether the kernel has a route to this multicast group; LCM's own message names the wrong one.
bool HasRoute(const sockaddr_in& group) {
  const int fd = socket(AF_INET, SOCK_DGRAM | SOCK_CLOEXEC, 0);
  if (fd < 0) return false;
  const bool routed = connect(fd, reinterpret_cast<const sockaddr*>(&group), sizeof group) == 0;
  close(fd);
  return routed;
}

void CheckMulticast(const std::string& url, std::string_view place) {
  const std::size_t question = place.find('?');
  const std::string_view options =
      question == std::string_view::npos ? std::string_view() : place.substr(question + 1);
  const std::string_view endpoint = place.substr(0, question);
  const std::size_t colon = endpoint.find(':');
  CheckOptions(url, options);
  const std::string address(endpoint.substr(0, colon));
  sockaddr_in group{};
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
}

void CheckUrl(const std::string& url) {
  const std::size_t scheme_end = url.find("://");
  if (scheme_end == std::string::npos) Refuse(url, "it has no scheme");
  const std::string scheme = url.substr(0, scheme_end);
  if (scheme == "udpm") {
    CheckMulticast(url, std::string_view(url).substr(scheme_end + 3));
  } else if (scheme != "tcpq" && scheme != "file" && scheme != "memq") {
    Refuse(url, fmt::format("unknown scheme '{}'", scheme));
  }
}

// Asks for the largest receive buffer that the kernel grants: a burst of large messages overflows
// the usual 208 KiB, and asking for more than is granted makes LCM print a warning.
std::string WithReceiveBuffer(const std::string& url) {
  if (!url.starts_with("udpm://") || url.find("recv_buf_size") != std::string::npos) return url;
  long granted = 0;
  std::ifstream("/proc/sys/net/core/rmem_max") >> granted;
  if (granted <= 0) return url;
  return fmt::format("{}{}recv_buf_size={}", url, url.find('?') == std::string::npos ? '?' : '&',
                     std::min(granted, kReceiveBufferBytes));
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

  static void OnMessage(const lcm_recv_buf_t* buffer, const char* /*channel*/, void* self) {
    auto& subscription = *static_cast<Subscription*>(self);
    ++subscription.bus->handled_;
    try {
      if (subscription.handler(buffer->data, static_cast<int>(buffer->data_size))) {
        ++subscription.counters.received;
      } else {
        ++subscription.counters.undecodable;
      }
    } catch (...) {  // LCM is C: an exception must not cross it
      ++subscription.counters.received;
      subscription.bus->handler_error_ = std::current_exception();
    }
  }
};

Bus::Bus(const std::string& url)
    : url_(url.empty() ? DefaultUrl() : url), lcm_(nullptr, &lcm_destroy) {
  CheckUrl(url_);
  lcm_.reset(lcm_create(WithReceiveBuffer(url_).c_str()));
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

void Bus::AddSubscription(const std::string& channel, int queue, RawHandler handler) {
  Subscription& subscription = subscriptions_.emplace_back();
  subscription.bus = this;
  subscription.counters.channel = channel;
  subscription.handler = std::move(handler);
  lcm_subscription_t* made =
      lcm_subscribe(lcm_.get(), channel.c_str(), &Subscription::OnMessage, &subscription);
  if (made == nullptr || FileDescriptor() < 0) {
    throw UserError(
        fmt::format("LCM URL '{}': cannot listen on channel {}; check whether a firewall blocks it",
                    url_, channel));
  }
  lcm_subscription_set_queue_capacity(made, queue);
}

int Bus::Handle(int timeout_ms) {
  handled_ = 0;
  int ready = lcm_handle_timeout(lcm_.get(), timeout_ms);
  while (ready > 0 && handled_ < kBurst && handler_error_ == nullptr) {
    ready = lcm_handle_timeout(lcm_.get(), 0);
  }
  if (handler_error_ != nullptr) std::rethrow_exception(std::exchange(handler_error_, nullptr));
  return static_cast<int>(handled_);
}

int Bus::FileDescriptor() { return lcm_get_fileno(lcm_.get()); }

std::vector<ChannelCounters> Bus::counters() const {
  std::vector<ChannelCounters> all;
  for (const Subscription& subscription : subscriptions_) all.push_back(subscription.counters);
  return all;
}

std::int64_t Bus::undecodable() const {
  std::int64_t sum = 0;
  for (const Subscription& subscription : subscriptions_) sum += subscription.counters.undecodable;
  return sum;
}

}  // namespace torquer::bus
