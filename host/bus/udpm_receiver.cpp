#include "host/bus/udpm_receiver.h"

#include <arpa/inet.h>
#include <fmt/format.h>
#include <linux/filter.h>
#include <linux/if_packet.h>
#include <net/if_arp.h>
#include <poll.h>
#include <signal.h>
#include <sys/eventfd.h>
#include <sys/socket.h>
#include <unistd.h>

#include <array>
#include <cerrno>
#include <new>
#include <system_error>

#include "host/bus/clock.h"

namespace torquer::bus {
namespace {

constexpr std::size_t kLargestDatagram = 65536;

// Memory in bytes that a queued message with `bytes` of data takes.
constexpr std::size_t Cost(std::size_t bytes) { return sizeof(UdpmReceiver::Received) + bytes; }

[[noreturn]] void Fail(const char* step) {
  throw std::system_error(errno, std::generic_category(), step);
}

template <class Value>
void Set(int socket, int level, int option, const Value& value, const char* step) {
  if (setsockopt(socket, level, option, &value, sizeof value) != 0) Fail(step);
}

// Attaches a kernel filter that passes only packets from this machine. These are its sent multicast
// and all packets of the loopback device. An address can be forged and changes with the network;
// the packet type cannot be forged and does not change.
void TakeThisMachineOnly(int socket) {
  std::array<sock_filter, 6> program = {{
      BPF_STMT(BPF_LD | BPF_W | BPF_ABS, static_cast<__u32>(SKF_AD_OFF + SKF_AD_PKTTYPE)),
      BPF_JUMP(BPF_JMP | BPF_JEQ | BPF_K, PACKET_LOOPBACK, 2, 0),
      BPF_STMT(BPF_LD | BPF_W | BPF_ABS, static_cast<__u32>(SKF_AD_OFF + SKF_AD_HATYPE)),
      BPF_JUMP(BPF_JMP | BPF_JEQ | BPF_K, ARPHRD_LOOPBACK, 0, 1),
      BPF_STMT(BPF_RET | BPF_K, kLargestDatagram),
      BPF_STMT(BPF_RET | BPF_K, 0),
  }};
  const sock_fprog filter{static_cast<unsigned short>(program.size()), program.data()};
  Set(socket, SOL_SOCKET, SO_ATTACH_FILTER, filter, "limiting it to this machine");
}

}  // namespace

std::string Describe(const Sender& sender) {
  if (sender == Sender{}) return "an unknown sender";
  // The address is 0 if this machine's route names none, as in a private network.
  if (sender.address == 0) return fmt::format("port {}", sender.port);
  return fmt::format("{}.{}.{}.{}:{}", sender.address >> 24, sender.address >> 16 & 0xff,
                     sender.address >> 8 & 0xff, sender.address & 0xff, sender.port);
}

UdpmReceiver::UdpmReceiver(const UdpmPlace& place) : buffer_(kLargestDatagram) {
  try {
    Open(place);
    // Signals must reach the thread that polls FileDescriptor(), so this thread blocks them all.
    sigset_t all;
    sigset_t before;
    sigfillset(&all);
    pthread_sigmask(SIG_SETMASK, &all, &before);
    thread_ = std::thread(&UdpmReceiver::Run, this);
    pthread_sigmask(SIG_SETMASK, &before, nullptr);
  } catch (...) {
    Close();
    throw;
  }
}

UdpmReceiver::~UdpmReceiver() {
  const std::uint64_t one = 1;
  [[maybe_unused]] const ssize_t written = write(stop_fd_, &one, sizeof one);
  thread_.join();
  Close();
}

void UdpmReceiver::Open(const UdpmPlace& place) {
  stop_fd_ = eventfd(0, EFD_CLOEXEC);
  waiting_fd_ = eventfd(0, EFD_CLOEXEC | EFD_NONBLOCK);
  socket_ = socket(AF_INET, SOCK_DGRAM | SOCK_CLOEXEC | SOCK_NONBLOCK, 0);
  if (stop_fd_ < 0 || waiting_fd_ < 0 || socket_ < 0) Fail("opening a socket");
  if (place.this_machine_only) TakeThisMachineOnly(socket_);
  Set(socket_, SOL_SOCKET, SO_REUSEADDR, 1, "sharing the port");
  // Without this, the socket also gets groups that other programs of this machine have joined.
  Set(socket_, IPPROTO_IP, IP_MULTICAST_ALL, 0, "choosing the group");
  if (place.receive_buffer_bytes > 0) {
    Set(socket_, SOL_SOCKET, SO_RCVBUF, place.receive_buffer_bytes, "enlarging the buffer");
  }
  // Bound to the group's address, not to any: unicast datagrams do not arrive.
  if (bind(socket_, reinterpret_cast<const sockaddr*>(&place.group), sizeof place.group) != 0) {
    Fail("taking the port");
  }
  const ip_mreq membership{place.group.sin_addr, {htonl(INADDR_ANY)}};
  Set(socket_, IPPROTO_IP, IP_ADD_MEMBERSHIP, membership, "joining the group");
}

void UdpmReceiver::Close() {
  for (const int fd : {socket_, stop_fd_, waiting_fd_}) {
    if (fd >= 0) close(fd);
  }
}

std::size_t UdpmReceiver::Listen(const std::string& channel, int most_waiting) {
  const std::lock_guard lock(mutex_);
  subscriptions_.push_back({.channel = channel, .most_waiting = most_waiting});
  return subscriptions_.size() - 1;
}

void UdpmReceiver::Run() {
  std::array<pollfd, 2> sources = {{{socket_, POLLIN, 0}, {stop_fd_, POLLIN, 0}}};
  while (sources[1].revents == 0) {
    if (poll(sources.data(), sources.size(), -1) > 0 && sources[0].revents != 0) TakeDatagrams();
  }
}

void UdpmReceiver::TakeDatagrams() {
  // A limited number per call, so that a flood cannot keep this thread from stopping.
  for (int taken = 0; taken < 64; ++taken) {
    sockaddr_in from{};
    socklen_t from_size = sizeof from;
    const ssize_t size = recvfrom(socket_, buffer_.data(), buffer_.size(), 0,
                                  reinterpret_cast<sockaddr*>(&from), &from_size);
    if (size < 0) return;
    const Sender sender{ntohl(from.sin_addr.s_addr), ntohs(from.sin_port)};
    try {
      UdpmAssembly::Message message;
      const auto outcome =
          assembly_.Take({buffer_.data(), static_cast<std::size_t>(size)}, sender, message);
      if (outcome == UdpmAssembly::Outcome::kMessage) Add(message, sender);
      if (outcome == UdpmAssembly::Outcome::kRefused) {
        const std::lock_guard lock(mutex_);
        ++damaged_.count;
        damaged_.last_sender = sender;
      }
    } catch (const std::bad_alloc&) {
      // This message is lost; the next may be smaller.
      continue;
    }
  }
}

void UdpmReceiver::Add(const UdpmAssembly::Message& message, const Sender& sender) {
  const std::lock_guard lock(mutex_);
  for (std::size_t k = 0; k < subscriptions_.size(); ++k) {
    Subscription& subscription = subscriptions_[k];
    if (subscription.channel != message.channel) continue;
    const bool full =
        subscription.most_waiting > 0 && subscription.waiting >= subscription.most_waiting;
    if (full || waiting_bytes_ + Cost(message.data.size()) > kMostWaitingBytes) {
      ++subscription.dropped;
      continue;
    }
    waiting_.push_back({k, {sender, MonotonicUs()}, {message.data.begin(), message.data.end()}});
    waiting_bytes_ += Cost(message.data.size());
    ++subscription.waiting;
    if (waiting_.size() == 1) eventfd_write(waiting_fd_, 1);
  }
}

std::optional<UdpmReceiver::Received> UdpmReceiver::Next() {
  const std::lock_guard lock(mutex_);
  if (waiting_.empty()) return std::nullopt;
  Received oldest = std::move(waiting_.front());
  waiting_.pop_front();
  waiting_bytes_ -= Cost(oldest.data.size());
  --subscriptions_[oldest.subscription].waiting;
  if (waiting_.empty()) {
    eventfd_t count = 0;
    eventfd_read(waiting_fd_, &count);
  }
  return oldest;
}

UdpmReceiver::Damaged UdpmReceiver::damaged() const {
  const std::lock_guard lock(mutex_);
  return damaged_;
}

std::int64_t UdpmReceiver::dropped(std::size_t subscription) const {
  const std::lock_guard lock(mutex_);
  return subscriptions_[subscription].dropped;
}

}  // namespace torquer::bus
