// What somebody far away does to the emulated device: lines of text on a TCP port, one answer each.
#pragma once

#include <cstdint>
#include <functional>
#include <string>

#include "host/emulator/bench_device.h"
#include "host/emulator/usb_host.h"

namespace torquer::emulator {

/// A hand that goes where it is told, in a straight line and in a given time, and stays there.
class GlidingHand {
 public:
  /// `time_s` is virtual time. Where the hand is keeps what else `target` says.
  void Glide(double time_s, const HandState& target, double duration_s);
  HandState At(double time_s) const;
  bool Moves(double time_s) const { return time_s < end_s_; }

 private:
  HandState from_, to_;
  double start_s_ = 0, end_s_ = 0;
};

/// Carries out one line:
///   state                     a JSON object: what device, sensor and hand do
///   move MM RAD SECONDS       the hand glides to that insertion and rotation
///   stick X Y                 joystick, -1 to 1
///   buttons BITS              protocol::Button bits, held from now on
///   unplug | plug             takes the supply away, or gives it back
///   restart                   the firmware restarts itself by its watchdog
///   reset                     the reset button
/// The answer has no line end; it begins with "error:" for a line that cannot be carried out.
class UsbipCommands {
 public:
  /// `state` adds to the answer of that name: JSON members, each followed by a comma.
  UsbipCommands(BenchDevice& device, UsbHost& host, std::function<std::string()> state);

  std::string Do(const std::string& line);

 private:
  std::string State() const;

  BenchDevice& device_;
  UsbHost& host_;
  std::function<std::string()> state_;
  GlidingHand hand_;
  std::int64_t restarts_ = 0;
};

/// Serves lines on 127.0.0.1, one client at a time.
class LinePort {
 public:
  /// Throws UserError where `port` (0: one that is free) cannot be used.
  LinePort(std::uint16_t port, std::function<std::string(const std::string&)> answer);
  ~LinePort();
  LinePort(const LinePort&) = delete;
  LinePort& operator=(const LinePort&) = delete;

  std::uint16_t port() const { return port_; }
  /// Accepts, and answers whole lines; never waits for one.
  void Service();

 private:
  void Close();

  std::function<std::string(const std::string&)> answer_;
  std::uint16_t port_ = 0;
  int listener_ = -1;
  int client_ = -1;
  std::string received_;
};

/// A socket that listens on 127.0.0.1:`port`, which is changed from 0 to the one taken. Throws
/// UserError, naming `option`.
int ListenOnLoopback(const std::string& option, std::uint16_t& port);

}  // namespace torquer::emulator
