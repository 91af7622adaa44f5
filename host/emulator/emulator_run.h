// One run of the emulator: device, host and front ends, from power-on to the summary.
#pragma once

#include <atomic>
#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "host/emulator/bench_device.h"
#include "host/emulator/live_bus.h"
#include "host/emulator/motion_script.h"
#include "host/emulator/socket_front.h"
#include "host/emulator/usb_host.h"
#include "host/support/random.h"

namespace torquer::emulator {

/// Something that lasts, in seconds of the motion.
struct Interval {
  double start_s = 0;
  double duration_s = 0;
};

struct RunOptions {
  std::string firmware;
  std::string bootloader;  ///< "": none
  std::string motion;      ///< file; empty: live over LCM
  std::string socket;
  std::string lcm_url;  ///< as for bus::Bus
  bool use_lcm = true;
  bool fast = false;  ///< as fast as it can, waiting for the client instead of losing reports
  bool wait_client = false;          ///< the motion begins when a client has connected
  std::optional<double> duration_s;  ///< of the motion; none: to the end of the file, or for ever
  std::string eeprom_file;           ///< read at the start if it exists, written at the end
  double drop_probability = 0;       ///< of a report on its way to the client
  double repeat_probability = 0;
  std::vector<Interval> lifts, faults, unplugs;
  std::vector<Interval> raises;  ///< the hand lifts the cylinder by its play
  std::vector<double> resets_s;
  BenchOptions bench;
};

struct RunSummary {
  std::int64_t reports_sent = 0;  ///< handed over by the device, dropped ones included
  std::int64_t reports_dropped = 0;
  std::int64_t reports_repeated = 0;
  std::int64_t axial_counts = 0;  ///< by the sensor
  std::int64_t transverse_counts = 0;
  std::optional<std::int64_t> catheter_axial_counts;  ///< by the second sensor, if there is one
  std::optional<std::int64_t> catheter_transverse_counts;
  std::int64_t violations = 0;  ///< of timing and of rules that hardware would punish
  std::vector<std::string> violation_texts;
  double time_simulated_s = 0;
  double cycles_used_fraction = 0;
  std::optional<double> latest_frame_ms;  ///< how late the latest frame began; none with --fast
  std::string serial;
};

class EmulatorRun {
 public:
  /// Throws UserError for anything that the user gave and that cannot be used.
  explicit EmulatorRun(const RunOptions& options);

  /// Until the motion is over or `stop` is set. Throws UserError if the EEPROM file cannot be
  /// written.
  RunSummary Run(const std::atomic<bool>& stop);

  const std::string& socket_path() const { return socket_.path(); }

 private:
  bool HeldForClient();
  bool Finished() const;
  double MotionTime(double time_s) const;
  HandState HandAt(double time_s) const;
  void Deliver(const std::vector<std::uint8_t>& report);
  void FollowEvents();
  void Pace();
  void Publish();
  void SaveEeprom() const;
  bus::HealthCounters Counters() const;

  RunOptions options_;
  MotionScript script_;
  LiveHand live_hand_;
  BenchDevice device_;
  UsbHost host_;
  SocketFront socket_;
  std::unique_ptr<LiveBus> bus_;
  Random random_;
  std::optional<double> motion_start_s_;
  bool client_awaited_ = false;  // none has connected since the device came to the bus
  std::int64_t awaited_since_ns_ = 0;
  std::size_t resets_done_ = 0;
  std::int64_t frames_ = 0;
  std::int64_t next_frame_ns_ = 0;
  LiveBus::Sent sent_;
  RunSummary summary_;
};

}  // namespace torquer::emulator
