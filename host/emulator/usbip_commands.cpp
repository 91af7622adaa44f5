#include "host/emulator/usbip_commands.h"

#include <arpa/inet.h>
#include <netinet/in.h>
#include <sys/socket.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <cmath>
#include <cstring>
#include <nlohmann/json.hpp>
#include <sstream>
#include <system_error>
#include <utility>

#include "host/support/error.h"
#include "protocol/hid_reports.h"

namespace torquer::emulator {
namespace {

constexpr std::size_t kLongestLine = 4096;

}  // namespace

void GlidingHand::Glide(double time_s, const HandState& target, double duration_s) {
  HandState from = At(time_s);
  legs_.clear();
  legs_.push_back({time_s, time_s + duration_s, from, target});
}

void GlidingHand::GlideOn(double time_s, const HandState& target, double duration_s) {
  if (!Moves(time_s)) return Glide(time_s, target, duration_s);
  const Leg last = legs_.back();
  legs_.push_back({last.end_s, last.end_s + duration_s, last.to, target});
}

HandState GlidingHand::At(double time_s) const {
  for (const Leg& leg : legs_) {
    if (time_s >= leg.end_s) continue;
    const double share = std::max(0.0, (time_s - leg.start_s) / (leg.end_s - leg.start_s));
    HandState hand = leg.to;
    hand.insertion_mm =
        leg.from.insertion_mm + share * (leg.to.insertion_mm - leg.from.insertion_mm);
    hand.rotation_rad =
        leg.from.rotation_rad + share * (leg.to.rotation_rad - leg.from.rotation_rad);
    return hand;
  }
  return Goal();
}

UsbipCommands::UsbipCommands(BenchDevice& device, UsbHost& host, std::function<std::string()> state)
    : device_(device), host_(host), state_(std::move(state)) {
  device_.SetHand([this](double time_s) { return hand_.At(time_s); });
}

std::string UsbipCommands::Do(const std::string& line) {
  std::istringstream words(line);
  std::string command;
  words >> command;
  const double now_s = device_.now_us() * 1e-6;
  HandState hand = hand_.At(now_s);
  if (command == "state") return State();
  if (command == "move" || command == "then") {
    if (command == "then") hand = hand_.Goal();
    double duration_s = 0;
    words >> hand.insertion_mm >> hand.rotation_rad >> duration_s;
    if (!words || !(duration_s >= 0) || !std::isfinite(hand.insertion_mm + hand.rotation_rad)) {
      return "error: " + command + " MM RAD SECONDS takes three numbers";
    }
    if (command == "then") {
      hand_.GlideOn(now_s, hand, duration_s);
    } else {
      hand_.Glide(now_s, hand, duration_s);
    }
    return "ok";
  }
  if (command == "stick") {
    words >> hand.joystick_x >> hand.joystick_y;
    if (!words || !(std::abs(hand.joystick_x) <= 1) || !(std::abs(hand.joystick_y) <= 1)) {
      return "error: stick X Y takes two numbers from -1 to 1";
    }
    hand_.Glide(now_s, hand, 0);
    return "ok";
  }
  if (command == "buttons") {
    int bits = 0;
    words >> bits;
    if (!words || bits < 0 || bits > 15) return "error: buttons BITS takes a number from 0 to 15";
    hand.buttons = static_cast<std::uint8_t>(bits);
    hand_.Glide(now_s, hand, 0);
    return "ok";
  }
  if (command == "unplug") {
    device_.PowerOff();
    return "ok";
  }
  if (command == "plug") {
    device_.PowerOn();
    return "ok";
  }
  if (command == "reset" && device_.powered()) {
    device_.ResetByPin();
    return "ok";
  }
  if (command == "cut") {
    int operations = 0;
    words >> operations;
    if (!words || operations < 1) return "error: cut OPERATIONS takes a number from 1 on";
    device_.CutPowerAtPageOperation(device_.page_operations() + operations);
    return "ok";
  }
  if (command == "restart" && host_.ready()) {
    host_.SubmitSetFeature({protocol::kCommandReportId, protocol::kCommandReset,
                            protocol::kCommandKey & 0xff, protocol::kCommandKey >> 8, 0, 0, 0, 0},
                           [this](const ControlResult& result) {
                             if (result.status == TransferStatus::kDone) ++restarts_;
                           });
    return "ok";
  }
  return "error: cannot do '" + line + "' now; there are state, move, then, stick, buttons, " +
         "unplug, plug, reset, restart, cut";
}

std::string UsbipCommands::State() const {
  const double now_s = device_.now_us() * 1e-6;
  nlohmann::ordered_json object;
  object["powered"] = device_.powered();
  object["ready"] = host_.ready();
  object["moving"] = hand_.Moves(now_s);
  object["time_s"] = now_s;
  object["axial_counts"] = device_.sensor().axial_counts();
  object["transverse_counts"] = device_.sensor().transverse_counts();
  object["restarts"] = restarts_;
  object["page_operations"] = device_.page_operations();
  object["violations"] = device_.violation_count();
  const std::string own = object.dump();
  return "{" + state_() + own.substr(1);
}

int ListenOnLoopback(const std::string& option, std::uint16_t& port) {
  const int listener = socket(AF_INET, SOCK_STREAM | SOCK_CLOEXEC | SOCK_NONBLOCK, 0);
  if (listener < 0) throw std::system_error(errno, std::generic_category(), "socket");
  const int yes = 1;
  setsockopt(listener, SOL_SOCKET, SO_REUSEADDR, &yes, sizeof(yes));
  sockaddr_in address{};
  address.sin_family = AF_INET;
  address.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
  address.sin_port = htons(port);
  if (bind(listener, reinterpret_cast<const sockaddr*>(&address), sizeof(address)) != 0 ||
      listen(listener, 4) != 0) {
    const std::string reason = std::strerror(errno);
    close(listener);
    throw UserError(option + " " + std::to_string(port) + ": cannot listen there: " + reason +
                    "; choose another, or 0 for one that is free");
  }
  socklen_t size = sizeof(address);
  getsockname(listener, reinterpret_cast<sockaddr*>(&address), &size);
  port = ntohs(address.sin_port);
  return listener;
}

LinePort::LinePort(std::uint16_t port, std::function<std::string(const std::string&)> answer)
    : answer_(std::move(answer)), port_(port), listener_(ListenOnLoopback("--commands", port_)) {}

LinePort::~LinePort() {
  Close();
  close(listener_);
}

void LinePort::Close() {
  if (client_ >= 0) close(client_);
  client_ = -1;
  received_.clear();
}

void LinePort::Service() {
  if (client_ < 0) client_ = accept4(listener_, nullptr, nullptr, SOCK_CLOEXEC | SOCK_NONBLOCK);
  std::array<char, 512> bytes{};
  while (client_ >= 0) {
    const ssize_t size = recv(client_, bytes.data(), bytes.size(), 0);
    if (size < 0 && (errno == EAGAIN || errno == EWOULDBLOCK || errno == EINTR)) break;
    if (size <= 0 || received_.size() > kLongestLine) return Close();
    received_.append(bytes.data(), static_cast<std::size_t>(size));
  }
  for (std::size_t end = received_.find('\n'); client_ >= 0 && end != std::string::npos;
       end = received_.find('\n')) {
    const std::string reply = answer_(received_.substr(0, end)) + "\n";
    received_.erase(0, end + 1);
    if (send(client_, reply.data(), reply.size(), MSG_NOSIGNAL) !=
        static_cast<ssize_t>(reply.size())) {
      return Close();  // who takes no answers gets none
    }
  }
}

}  // namespace torquer::emulator
