// USB/IP front on loopback; the test plays the kernel. Tested are imports, the end of transfers,
// the loss of the device, and bytes that no kernel sends.
#include "host/emulator/usbip_front.h"

#include <arpa/inet.h>
#include <netinet/in.h>
#include <netinet/tcp.h>
#include <sys/socket.h>
#include <unistd.h>

#include <algorithm>
#include <catch2/catch.hpp>
#include <cerrno>
#include <functional>
#include <memory>
#include <random>

#include "host/emulator/usbip_commands.h"
#include "protocol/hid_descriptor.h"
#include "protocol/hid_reports.h"
#include "tests/support/paths.h"

namespace {

namespace usbip = torquer::emulator::usbip;
namespace protocol = torquer::protocol;
using torquer::emulator::BenchDevice;
using torquer::emulator::FirmwareImage;
using torquer::emulator::UsbHost;
using torquer::emulator::UsbipCommands;
using torquer::emulator::UsbipFront;
using usbip::Bytes;

torquer::emulator::BenchOptions Options() {
  torquer::emulator::BenchOptions options;
  options.serial = "GUEST-1";
  return options;
}

struct Reply {
  std::uint32_t command = 0;
  std::uint32_t sequence = 0;
  std::int32_t status = 0;
  Bytes data;
};

// A device, its front, and a kernel at the other end.
struct Bench {
  Bench() {
    REQUIRE(host.RunUntilReady());
    Connect();
  }
  ~Bench() { close(client); }

  void Connect() {
    if (client >= 0) close(client);
    client = socket(AF_INET, SOCK_STREAM, 0);
    sockaddr_in address{};
    address.sin_family = AF_INET;
    address.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
    address.sin_port = htons(front.port());
    REQUIRE(connect(client, reinterpret_cast<const sockaddr*>(&address), sizeof(address)) == 0);
    const int yes = 1;
    setsockopt(client, IPPROTO_TCP, TCP_NODELAY, &yes, sizeof(yes));
  }
  void Send(const Bytes& bytes) {
    REQUIRE(send(client, bytes.data(), bytes.size(), MSG_NOSIGNAL) ==
            static_cast<ssize_t>(bytes.size()));
  }
  // Runs frames until `size` bytes have arrived; fewer if the connection ends.
  Bytes Receive(std::size_t size) {
    Bytes bytes;
    for (int turn = 0; turn < 100000 && bytes.size() < size; ++turn) {
      front.Service();
      if (time_passes && !front.HoldsFrame()) host.RunFrame();
      Bytes part(size - bytes.size());
      const ssize_t got = recv(client, part.data(), part.size(), MSG_DONTWAIT);
      if (got == 0 || (got < 0 && errno != EAGAIN)) {
        ended = true;
        break;
      }
      bytes.insert(bytes.end(), part.begin(), part.begin() + std::max<ssize_t>(got, 0));
    }
    return bytes;
  }
  Bytes Import(const std::string& bus_id) {
    Bytes request{0x01, 0x11, 0x80, 0x03, 0, 0, 0, 0};
    request.insert(request.end(), bus_id.begin(), bus_id.end());
    request.resize(usbip::kOperationBytes + usbip::kBusIdBytes);
    Send(request);
    const Bytes head = Receive(usbip::kOperationBytes);
    REQUIRE(head.size() == usbip::kOperationBytes);
    CHECK(usbip::U32At(head, 0) == 0x01110003);
    if (usbip::U32At(head, 4) != 0) return {};
    return Receive(usbip::kDeviceBytes);
  }
  std::uint32_t Submit(std::uint32_t endpoint, bool to_host, std::uint32_t length,
                       const Bytes& setup = Bytes(8), const Bytes& data = {}) {
    Bytes message;
    for (const std::uint32_t value : {usbip::kSubmit, ++sequence, 0x10002U, to_host ? 1U : 0U,
                                      endpoint, 0U, length, 0U, 0U, 0U}) {
      usbip::AppendU32(message, value);
    }
    message.insert(message.end(), setup.begin(), setup.end());
    message.insert(message.end(), data.begin(), data.end());
    Send(message);
    return sequence;
  }
  std::uint32_t Unlink(std::uint32_t victim) {
    Bytes message;
    for (const std::uint32_t value : {usbip::kUnlink, ++sequence, 0x10002U, 0U, 0U, victim}) {
      usbip::AppendU32(message, value);
    }
    message.resize(usbip::kTransferBytes);
    Send(message);
    return sequence;
  }
  Reply Next(bool to_host = true) {
    const Bytes head = Receive(usbip::kTransferBytes);
    if (head.size() < usbip::kTransferBytes) return {};
    Reply reply{usbip::U32At(head, 0),
                usbip::U32At(head, 4),
                static_cast<std::int32_t>(usbip::U32At(head, 20)),
                {}};
    const std::uint32_t actual = usbip::U32At(head, 24);
    if (reply.command == usbip::kReturnSubmit && to_host && actual != 0) {
      reply.data = Receive(actual);
    }
    return reply;
  }
  Reply Control(const Bytes& setup, const Bytes& data = {}) {
    const bool to_host = setup[0] & 0x80;
    const auto length = static_cast<std::uint32_t>(setup[6] | (setup[7] << 8));
    const std::uint32_t asked = Submit(0, to_host, length, setup, data);
    Reply reply = Next(to_host);
    CHECK(reply.sequence == asked);
    return reply;
  }
  void PassFrames(int frames) {
    for (int i = 0; i < frames; ++i) {
      front.Service();
      host.RunFrame();
    }
  }

  BenchDevice device{FirmwareImage(torquer::test::FirmwarePath("torquer-firmware.elf")), Options()};
  UsbHost host{device};
  UsbipFront front{host, 0};
  UsbipCommands commands{device, host, [] { return std::string(); }};
  int client = -1;
  bool ended = false;
  bool time_passes = true;
  std::uint32_t sequence = 0;
};

protocol::InputReport ReportIn(const Reply& reply) {
  protocol::InputReport report{};
  REQUIRE(reply.data.size() == sizeof(report));
  std::copy(reply.data.begin(), reply.data.end(), reinterpret_cast<std::uint8_t*>(&report));
  return report;
}

}  // namespace

TEST_CASE("USB/IP: the device is listed, and the connection ends") {
  Bench bench;
  bench.Send({0x01, 0x11, 0x80, 0x05, 0, 0, 0, 0});
  const Bytes reply = bench.Receive(1000);
  REQUIRE(reply.size() == usbip::kOperationBytes + 4 + usbip::kDeviceBytes + 4);
  CHECK(bench.ended);
  CHECK(usbip::U32At(reply, 0) == 0x01110005);
  CHECK(usbip::U32At(reply, 8) == 1);
  CHECK(std::string(reinterpret_cast<const char*>(&reply[12 + 256])) == "1-1");
  CHECK(usbip::U32At(reply, 12 + 256 + 32 + 8) == 2);            // full speed
  CHECK(usbip::U32At(reply, 12 + 256 + 32 + 12) == 0x12090001);  // vendor, product
  CHECK(reply[reply.size() - 4] == 3);                           // HID
}

TEST_CASE("USB/IP: imported, it answers control transfers as the device does") {
  Bench bench;
  CHECK(bench.Import("2-1").empty());
  CHECK(bench.Receive(1).empty());
  CHECK(bench.ended);
  bench.Connect();
  REQUIRE(bench.Import("1-1").size() == usbip::kDeviceBytes);
  CHECK(bench.front.imported());

  const Reply device = bench.Control({0x80, 6, 0, 1, 0, 0, 18, 0});
  CHECK(device.status == 0);
  CHECK(device.data == bench.host.enumeration().device_descriptor);
  const Reply report = bench.Control({0x81, 6, 0, 0x22, 0, 0, 0, 1});
  CHECK(report.data == Bytes(std::begin(protocol::kHidReportDescriptor),
                             std::end(protocol::kHidReportDescriptor)));
  const Reply set = bench.Control({0, 9, 1, 0, 0, 0, 0, 0});
  CHECK(set.status == 0);
  // Writes a feature report and reads it back.
  Bytes configuration{3, protocol::kProtocolVersion, 0x40, 0x06, 7, 0};  // 1600 cpi
  configuration.resize(sizeof(protocol::ConfigurationReport));
  CHECK(bench.Control({0x21, 9, 3, 3, 0, 0, 16, 0}, configuration).status == 0);
  CHECK(bench.Control({0xa1, 1, 3, 3, 0, 0, 16, 0}).data == configuration);
  // A request that the device refuses, and an endpoint that it does not have.
  CHECK(bench.Control({0xa1, 1, 9, 3, 0, 0, 16, 0}).status == -EPIPE);
  bench.Submit(3, true, 32);
  CHECK(bench.Next().status == -EPIPE);
}

TEST_CASE("USB/IP: frames wait for the kernel, so that no report is lost") {
  Bench bench;
  REQUIRE_FALSE(bench.Import("1-1").empty());
  bench.PassFrames(500);  // start-up of the sensor
  bench.commands.Do("move 10 1 0.1");
  for (int i = 0; i < 3; ++i) bench.Submit(1, true, 32);
  std::uint16_t sequence = ReportIn(bench.Next()).sequence;
  protocol::InputReport last{};
  for (int i = 0; i < 300; ++i) {
    bench.Submit(1, true, 32);
    last = ReportIn(bench.Next());
    REQUIRE(last.sequence == static_cast<std::uint16_t>(sequence + 1));
    sequence = last.sequence;
  }
  CHECK(last.axial_counts == bench.device.sensor().axial_counts());
  CHECK(last.axial_counts == Approx(10 * 1200 / 25.4).margin(2));
  // Without a pending transfer, time stops; after the kernel unlinks one, it continues.
  for (int i = 0; i < 2; ++i) bench.Next();
  CHECK(bench.front.HoldsFrame());
  const double held_us = bench.device.now_us();
  bench.front.Service();
  CHECK(bench.device.now_us() == held_us);
  const std::uint32_t pending = bench.Submit(1, true, 32);
  bench.front.Service();
  const std::uint32_t unlinked = bench.Unlink(pending);
  bench.time_passes = false;
  const Reply reply = bench.Next();
  CHECK(reply.command == usbip::kReturnUnlink);
  CHECK(reply.sequence == unlinked);
  CHECK(reply.status == -ECONNRESET);
  CHECK_FALSE(bench.front.HoldsFrame());
  // A completed transfer is not unlinked.
  bench.Unlink(pending);
  CHECK(bench.Next().status == 0);
  CHECK(bench.device.violation_count() == 0);
}

TEST_CASE("USB/IP: the connection ends with the device, and a new one begins with it") {
  Bench bench;
  REQUIRE_FALSE(bench.Import("1-1").empty());
  bench.Submit(1, true, 32);
  ReportIn(bench.Next());
  for (const char* loss : {"unplug", "restart", "reset"}) {
    CHECK(bench.commands.Do(loss) == "ok");
    bench.ended = false;
    bench.PassFrames(50);
    bench.Receive(4096);
    CHECK(bench.ended);
    if (std::string(loss) == "unplug") {
      bench.Connect();
      CHECK(bench.Import("1-1").empty());  // no such device
      bench.commands.Do("plug");
    }
    REQUIRE(bench.host.RunUntilReady());
    bench.Connect();
    REQUIRE_FALSE(bench.Import("1-1").empty());
    bench.Submit(1, true, 32);
    ReportIn(bench.Next());
  }
}

TEST_CASE("USB/IP: invalid bytes end only the connection") {
  Bench bench;
  std::mt19937 random(7);
  for (int round = 0; round < 60; ++round) {
    bench.Connect();
    const bool imported = round % 2 == 0 && !bench.Import("1-1").empty();
    Bytes noise(1 + random() % 400);
    for (auto& byte : noise) byte = static_cast<std::uint8_t>(random());
    if (imported) {
      // Begins like a transfer, with false lengths.
      Bytes head;
      usbip::AppendU32(head, 1 + random() % 2);
      noise.insert(noise.begin(), head.begin(), head.end());
    }
    bench.Send(noise);
    bench.PassFrames(5);
  }
  bench.Connect();
  bench.PassFrames(1100);  // transfers started by the noise time out
  REQUIRE_FALSE(bench.Import("1-1").empty());
  CHECK(bench.Control({0x80, 6, 0, 1, 0, 0, 18, 0}).status == 0);
}

TEST_CASE("Commands: the hand moves from place to place") {
  torquer::emulator::GlidingHand hand;
  CHECK_FALSE(hand.Moves(0));
  hand.Glide(1.0, {.insertion_mm = 10, .rotation_rad = 1}, 2.0);
  hand.GlideOn(1.5, {.insertion_mm = 4, .buttons = 1}, 1.0);
  CHECK(hand.At(0.5).insertion_mm == 0);
  CHECK(hand.At(2.0).insertion_mm == Approx(5));
  CHECK(hand.At(3.5).insertion_mm == Approx(7));
  CHECK(hand.At(3.5).rotation_rad == Approx(0.5));
  CHECK(hand.Moves(3.9));
  CHECK(hand.At(9.0).insertion_mm == 4);
  CHECK(hand.At(9.0).buttons == 1);
  CHECK_FALSE(hand.Moves(9.0));
  hand.GlideOn(10.0, {.insertion_mm = 5}, 1.0);
  CHECK(hand.At(10.5).insertion_mm == Approx(4.5));
}

TEST_CASE("Commands: the power is cut at a page operation of the flash") {
  Bench bench;
  CHECK(bench.commands.Do("cut 3") == "ok");
  CHECK(bench.commands.Do("state").find("\"page_operations\":0") != std::string::npos);
}

TEST_CASE("Commands: impossible ones are reported") {
  Bench bench;
  for (const char* line : {"", "fly", "move 1 2", "move 1 2 -1", "move nan 0 1", "stick 2 0",
                           "buttons 16", "buttons -1", "stick", "cut", "cut 0", "then 1"}) {
    CHECK(bench.commands.Do(line).starts_with("error: "));
  }
  CHECK(bench.commands.Do("state").find("\"ready\":true") != std::string::npos);
  bench.commands.Do("unplug");
  bench.PassFrames(2);
  CHECK(bench.commands.Do("restart").starts_with("error: "));
  CHECK(bench.commands.Do("state").find("\"powered\":false") != std::string::npos);
}
