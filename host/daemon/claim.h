// What a daemon claims for itself, so that no second one drives the same instrument or reads the
// same device, and what it leaves behind for the daemon that follows it: the last published pose.
//
// Claims are locked files in $XDG_RUNTIME_DIR/torquer (without that variable in a folder of the
// user's own under /tmp). An instrument is claimed for one bus, that is one LCM URL in one network
// namespace. The pose is kept in a mapped file, so that it costs no system call to update and
// outlives a daemon that was killed at any instant.
#pragma once

#include <cstdint>
#include <optional>
#include <string>

#include "host/daemon/hand_tracker.h"

namespace torquer::daemon {

/// A lock held until destruction (or the end of the process, however it ends).
class Claim {
 public:
  /// Claims what `name` stands for; throws UserError naming `what` and the process that has it.
  Claim(const std::string& name, const std::string& what);
  ~Claim();
  Claim(const Claim&) = delete;
  Claim& operator=(const Claim&) = delete;

  int file() const { return fd_; }

 private:
  int fd_ = -1;
};

/// The process that holds the claim `name`, if any.
std::optional<int> ClaimHolder(const std::string& name);

/// Name of the claim on a device: its serial number, or the path behind which it lives.
std::string DeviceClaimName(const std::string& device);

/// Name of the claim on an instrument on the bus at `lcm_url`, seen from this network namespace.
std::string InstrumentClaimName(const std::string& instrument, const std::string& lcm_url);

/// What was published last.
struct LastCommand {
  Pose pose;
  std::int64_t sequence = -1;
  std::int64_t publish_us = 0;
  std::int64_t clock_id = 0;
};

/// The claim on an instrument, and its last command.
class InstrumentClaim {
 public:
  InstrumentClaim(const std::string& instrument, const std::string& lcm_url);
  ~InstrumentClaim();

  /// What the daemon before this one published last, if anything is known of it.
  const std::optional<LastCommand>& previous() const { return previous_; }

  /// Notes what was published. A crash at any instant leaves this or the one before.
  void Remember(const LastCommand& command);

 private:
  struct Record;

  Claim claim_;
  Record* record_ = nullptr;
  std::uint64_t count_ = 0;
  std::optional<LastCommand> previous_;
};

}  // namespace torquer::daemon
