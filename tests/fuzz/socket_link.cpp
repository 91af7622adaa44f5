// Fuzz target for the daemon's socket: packets from the device's end. The first byte selects the
// daemon's request; the packets follow (target.h).
#include <sys/socket.h>
#include <sys/un.h>
#include <unistd.h>

#include <cstring>
#include <stdexcept>

#include "host/device/device_identity.h"
#include "host/device/socket_source.h"
#include "host/support/error.h"
#include "tests/fuzz/target.h"
#include "tests/support/temporary_folder.h"

namespace torquer::fuzz::socket_link_target {
namespace {

using protocol::SocketPacket;

Bytes Packet(SocketPacket kind, std::span<const std::uint8_t> payload) {
  Bytes packet = {static_cast<std::uint8_t>(kind)};
  packet.insert(packet.end(), payload.begin(), payload.end());
  return packet;
}

std::vector<Bytes> Seeds() {
  protocol::IdentityReport identity{};
  identity.report_id = protocol::kIdentityReportId;
  identity.protocol_version = protocol::kProtocolVersion;
  std::memcpy(identity.serial, "FUZZ-1", 6);
  const Bytes input(32, 1);
  const auto* bytes = reinterpret_cast<const std::uint8_t*>(&identity);
  Bytes asked = {1}, streamed = {0}, refused = {1}, set = {2};
  AppendPacket(asked, Packet(SocketPacket::kInput, input));
  AppendPacket(asked, Packet(SocketPacket::kFeature, {bytes, sizeof identity}));
  AppendPacket(streamed, Packet(SocketPacket::kInput, input));
  AppendPacket(streamed, Packet(SocketPacket::kInput, input));
  AppendPacket(refused, Packet(SocketPacket::kInput, input));
  AppendPacket(refused, Packet(SocketPacket::kStall, {}));
  AppendPacket(refused, Packet(SocketPacket::kInput, input));
  AppendPacket(set, Packet(SocketPacket::kDone, {}));
  AppendPacket(set, Packet(SocketPacket::kInput, input));
  return {asked, streamed, refused, set};
}

class Listener {
 public:
  Listener() : path_(folder_.Path("device.sock")) {
    fd_ = socket(AF_UNIX, SOCK_SEQPACKET | SOCK_CLOEXEC | SOCK_NONBLOCK, 0);
    sockaddr_un address{};
    address.sun_family = AF_UNIX;
    std::strncpy(address.sun_path, path_.c_str(), sizeof address.sun_path - 1);
    if (bind(fd_, reinterpret_cast<sockaddr*>(&address), sizeof address) != 0 ||
        listen(fd_, 4) != 0) {
      throw std::logic_error("cannot listen at " + path_);
    }
  }
  ~Listener() { close(fd_); }
  const std::string& path() const { return path_; }
  int Accept() const { return accept4(fd_, nullptr, nullptr, SOCK_CLOEXEC); }

 private:
  test::TemporaryFolder folder_;
  std::string path_;
  int fd_ = -1;
};

void Ask(device::SocketSource& source, int what) {
  try {
    if (what % 3 == 1) device::ReadIdentity(source);
    if (what % 3 == 2) source.SetFeature(Bytes(4, 3));
  } catch (const device::FeatureError&) {
    return;
  } catch (const UserError&) {
    return;
  }
}

// True if an input report was received.
bool Accepts(std::span<const std::uint8_t> input) {
  static const Listener listener;
  device::SocketSource source(listener.path());
  int reports = 0;
  const auto sink = [&reports](const device::SourceEvent& event) {
    if (event.kind == device::SourceEvent::Kind::kReport) ++reports;
  };
  source.Wait(0, sink);
  const int device = listener.Accept();
  Reader packets(input);
  const int asked = packets.Byte();
  while (!packets.empty()) {
    const auto packet = packets.Take(packets.Word());
    send(device, packet.data(), packet.size(), MSG_NOSIGNAL | MSG_DONTWAIT);
  }
  shutdown(device, SHUT_WR);  // so that the request does not wait
  Ask(source, asked);
  for (int k = 0; k < 3; ++k) source.Wait(0, sink);
  close(device);
  // The source may have reconnected.
  for (int again = listener.Accept(); again >= 0; again = listener.Accept()) close(again);
  return reports > 0;
}

const Registration kRegistration(
    {.name = "socket_link", .seeds = Seeds, .accepts = Accepts, .replay_inputs = 10000});

}  // namespace
}  // namespace torquer::fuzz::socket_link_target
