// Remote commands to the emulated device: lines of text on a TCP port, one answer each.
#pragma once

#include <cstdint>
#include <functional>
#include <string>
#include <vector>

#include "host/emulator/bench_device.h"
#include "host/emulator/usb_host.h"

namespace torquer::emulator {

/// Hand that moves to commanded positions in order, each in a straight line and in a given time. It
/// stays at the last position.
class GlidingHand {
 public:
  /// Moves from the position at `time_s` (virtual) to `target`. Stick and buttons change at once.
  void Glide(double time_s, const HandState& target, double duration_s);
  /// Moves to `target` after the last commanded position is reached.
  void GlideOn(double time_s, const HandState& target, double duration_s);
  HandState At(double time_s) const;
  /// Last commanded state of the hand.
  HandState Goal() const { return legs_.empty() ? HandState{} : legs_.back().to; }
  bool Moves(double time_s) const { return !legs_.empty() && time_s < legs_.back().end_s; }

 private:
  struct Leg {
    double start_s = 0, end_s = 0;
    HandState from, to;
  };
  std::vector<Leg> legs_;
};

/// Carries out one line:
///   state                     a JSON object: state of device, sensor and hand
///   move MM RAD SECONDS       the hand glides to that insertion and rotation
///   then MM RAD SECONDS       moves there after the last commanded position
///   stick X Y                 joystick, -1 to 1
///   buttons BITS              protocol::Button bits, held from now on
///   unplug | plug             switches the supply off or on
///   restart                   the firmware restarts itself by its watchdog
///   reset                     the reset button
///   cut OPERATIONS            switches the supply off at that page operation of the flash, from
///   now
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
  /// Throws UserError if `port` cannot be used; 0 chooses a free port.
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
