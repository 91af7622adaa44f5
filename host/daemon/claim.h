// Claims of a daemon: no second daemon can drive the same instrument or read the same device. An
// instrument is claimed on one bus. Its claim also stores the last published pose, from which the
// next daemon continues. The pose is in a mapped file. An update costs no system call, and survives
// if the daemon is killed at any time.
#pragma once

#include <cstdint>
#include <optional>
#include <string>

#include "host/bus/claim.h"
#include "host/daemon/hand_tracker.h"

namespace torquer::daemon {

/// Name of the claim on a device, made of its serial number or its path.
std::string DeviceClaimName(const std::string& device);

/// Name of the claim on an instrument on the bus at `lcm_url`, seen from this network namespace.
std::string InstrumentClaimName(const std::string& instrument, const std::string& lcm_url);

/// The command that was published last.
struct LastCommand {
  Pose pose;
  std::int64_t sequence = -1;
  std::int64_t boottime_us = 0;  ///< time of the command by BoottimeUs(), which includes sleep
  std::int64_t clock_id = 0;
};

/// The claim on an instrument, and its last command.
class InstrumentClaim {
 public:
  InstrumentClaim(const std::string& instrument, const std::string& lcm_url);
  ~InstrumentClaim();

  /// The last command of the previous daemon; nullopt if unknown.
  const std::optional<LastCommand>& previous() const { return previous_; }

  /// Stores the published command. A crash at any instant leaves this command or the previous one.
  void Remember(const LastCommand& command);

 private:
  struct Record;

  bus::Claim claim_;
  Record* record_ = nullptr;
  std::uint64_t count_ = 0;
  std::optional<LastCommand> previous_;
};

}  // namespace torquer::daemon
