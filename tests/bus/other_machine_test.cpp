// Isolation test: two network namespaces joined by a cable (veth) stand for this machine and
// another.
#include <fmt/format.h>
#include <sched.h>
#include <sys/wait.h>
#include <unistd.h>

#include <catch2/catch.hpp>
#include <csignal>
#include <cstdlib>
#include <string>

#include "host/bus/bus.h"
#include "host/bus/clock.h"
#include "tests/bus/datagrams.h"
#include "tests/support/private_network.h"
#include "tests/support/sample_messages.h"
#include "torquer_lcm/instrument_command_t.hpp"

namespace {

using torquer::bus::Bus;
using torquer_lcm::instrument_command_t;

constexpr int kDatagrams = 50;

bool Shell(const std::string& command) { return std::system(command.c_str()) == 0; }

torquer::test::Bytes Command(const std::string& instrument) {
  instrument_command_t command{};
  command.instrument = instrument;
  torquer::test::Bytes bytes(static_cast<std::size_t>(command.getEncodedSize()));
  command.encode(bytes.data(), 0, static_cast<int>(bytes.size()));
  return torquer::test::WholeDatagram("A", bytes);
}

// A process in its own namespace at the other end of a cable. This end has 10.77.0.1, and multicast
// goes through it.
class OtherMachine {
 public:
  OtherMachine() {
    REQUIRE(pipe(ready_) == 0);
    REQUIRE(pipe(go_) == 0);
    child_ = fork();
    if (child_ == 0) _exit(Other());
    char byte = 0;
    REQUIRE(read(ready_[0], &byte, 1) == 1);
    REQUIRE(
        Shell(fmt::format("ip link add here type veth peer name there netns {} && "
                          "ip address add 10.77.0.1/24 dev here && ip link set here up && "
                          "ip route replace 224.0.0.0/4 dev here",
                          child_)));
  }
  ~OtherMachine() {
    kill(child_, SIGKILL);
    waitpid(child_, nullptr, 0);
    // Deleting the other end removes the cable.
    Shell("ip link delete here 2>/dev/null; ip route replace 224.0.0.0/4 dev lo");
    for (const int fd : {ready_[0], ready_[1], go_[0], go_[1]}) close(fd);
  }
  OtherMachine(const OtherMachine&) = delete;
  OtherMachine& operator=(const OtherMachine&) = delete;

  // Sends commands to the group and to this machine alone; returns when all are sent.
  void Send() const {
    REQUIRE(write(go_[1], "g", 1) == 1);
    char byte = 0;
    REQUIRE(read(ready_[0], &byte, 1) == 1);
    CHECK(byte == 's');
  }

 private:
  int Other() const {
    if (unshare(CLONE_NEWNET) != 0) return 1;
    char byte = 0;
    if (write(ready_[1], "r", 1) != 1 || read(go_[0], &byte, 1) != 1) return 1;
    const bool up = Shell(
        "ip link set lo up && ip address add 10.77.0.2/24 dev there && ip link set there up && "
        "ip route add 224.0.0.0/4 dev there");
    try {
      const torquer::test::DatagramSocket socket;
      for (int k = 0; up && k < kDatagrams; ++k) {
        socket.Send(Command("by multicast"), "239.255.76.67", 1);
        socket.Send(Command("by unicast"), "10.77.0.1");
      }
    } catch (const std::exception&) {
      return 1;
    }
    if (write(ready_[1], up ? "s" : "x", 1) != 1) return 1;
    pause();
    return 0;
  }

  int ready_[2] = {-1, -1};
  int go_[2] = {-1, -1};
  pid_t child_ = -1;
};

// Counts received commands by their text.
struct Listener {
  explicit Listener(const std::string& url) : bus(url) {
    bus.Subscribe<instrument_command_t>(
        "A",
        [this](const instrument_command_t& command) {
          if (command.instrument == "by multicast") ++by_multicast;
          if (command.instrument == "by unicast") ++by_unicast;
          if (command.instrument == "from here") ++from_here;
        },
        0);
  }
  template <class Done>
  bool HandleUntil(Done done) {
    const std::int64_t end_us = torquer::bus::MonotonicUs() + 60'000'000;
    while (!done() && torquer::bus::MonotonicUs() < end_us) bus.Handle(50);
    return done();
  }

  Bus bus;
  int by_multicast = 0;
  int by_unicast = 0;
  int from_here = 0;
};

}  // namespace

TEST_CASE("By default no message from another machine reaches a program") {
  torquer::test::NeedPrivateNetwork();
  const OtherMachine other;
  Listener by_default("");
  Listener network("udpm://239.255.76.67:7667?ttl=1");
  Bus here;
  other.Send();
  // The listener on the network receives from the other machine, so the cable works.
  REQUIRE(network.HandleUntil([&] { return network.by_multicast == kDatagrams; }));
  // Both listeners receive a local message, after everything that was sent before it.
  instrument_command_t command{};
  command.instrument = "from here";
  REQUIRE(here.Publish("A", command));
  REQUIRE(network.HandleUntil([&] { return network.from_here == 1; }));
  REQUIRE(by_default.HandleUntil([&] { return by_default.from_here == 1; }));
  CHECK(by_default.by_multicast == 0);
  CHECK(by_default.by_unicast == 0);
  CHECK(network.by_unicast == 0);
}
