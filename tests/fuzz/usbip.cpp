// Fuzz target for torquer-emulator-usbip: bytes from a kernel or from a stranger. The device keeps
// its state between inputs, so a failing input may need the earlier ones.
#include <arpa/inet.h>
#include <sys/socket.h>
#include <unistd.h>

#include <stdexcept>

#include "host/emulator/usbip_front.h"
#include "host/emulator/usbip_messages.h"
#include "tests/fuzz/target.h"
#include "tests/support/paths.h"

namespace torquer::fuzz::usbip_target {
namespace {

using namespace emulator;

struct Server {
  BenchDevice device{FirmwareImage(test::FirmwarePath("torquer-firmware.elf")), {}};
  UsbHost host{device};
  UsbipFront front{host, 0};
  Server() {
    if (!host.RunUntilReady()) throw std::logic_error("the emulated device does not start");
  }
};

Bytes Import() {
  Bytes bytes = {1, 0x11, 0x80, 3, 0, 0, 0, 0, '1', '-', '1'};
  bytes.resize(usbip::kOperationBytes + usbip::kBusIdBytes);
  return bytes;
}

void AppendTransfer(Bytes& out, std::uint32_t command, std::uint32_t endpoint,
                    std::array<std::uint8_t, 8> setup, std::uint32_t length) {
  for (const std::uint32_t word : {command, 7U, 0U, 1U, endpoint, 0U, length, 0U, 0U, 0U}) {
    usbip::AppendU32(out, word);
  }
  out.insert(out.end(), setup.begin(), setup.end());
}

std::vector<Bytes> Seeds() {
  const Bytes devices = {1, 0x11, 0x80, 5, 0, 0, 0, 0};
  Bytes reads = Import(), writes = Import(), inputs = Import();
  AppendTransfer(reads, usbip::kSubmit, 0, {0x80, 6, 0, 1, 0, 0, 18, 0}, 18);
  AppendTransfer(reads, usbip::kSubmit, 0, {0xa1, 1, 2, 3, 0, 0, 64, 0}, 64);
  for (int k = 0; k < 2; ++k) AppendTransfer(inputs, usbip::kSubmit, 1, {}, 64);
  AppendTransfer(inputs, usbip::kUnlink, 0, {}, 0);
  AppendTransfer(writes, usbip::kSubmit, 0, {0x21, 9, 3, 3, 0, 0, 6, 0}, 6);
  writes[usbip::kOperationBytes + usbip::kBusIdBytes + 15] = 0;  // direction: to the device
  writes.insert(writes.end(), {3, 1, 0xb0, 4, 20, 0});
  return {devices, reads, writes, inputs};
}

// True if the server sent an answer.
bool Accepts(std::span<const std::uint8_t> input) {
  static Server server;
  const int client = socket(AF_INET, SOCK_STREAM | SOCK_CLOEXEC, 0);
  sockaddr_in address{};
  address.sin_family = AF_INET;
  address.sin_port = htons(server.front.port());
  address.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
  if (connect(client, reinterpret_cast<sockaddr*>(&address), sizeof address) != 0) {
    throw std::logic_error("cannot connect");
  }
  send(client, input.data(), input.size(), MSG_NOSIGNAL | MSG_DONTWAIT);
  for (int k = 0; k < 3; ++k) {
    server.front.Service();
    server.host.RunFrame();
  }
  server.front.Service();
  std::uint8_t answer = 0;
  const bool answered = recv(client, &answer, 1, MSG_DONTWAIT) == 1;
  close(client);
  server.front.Service();
  return answered;
}

const Registration kRegistration(
    {.name = "usbip", .seeds = Seeds, .accepts = Accepts, .replay_inputs = 300});

}  // namespace
}  // namespace torquer::fuzz::usbip_target
