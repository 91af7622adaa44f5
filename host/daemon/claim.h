// Claims, so that no second daemon drives the same instrument or reads the same device, and the
// last published pose, which the next daemon takes up.
//
// Claims are locked files in $XDG_RUNTIME_DIR/torquer (without that variable in a private folder
// under /tmp). An instrument is claimed on one bus, that is one LCM URL in one network namespace.
// The pose is kept in a mapped file, so that an update costs no system call, and is still there
// when the daemon is killed at any instant.
#pragma once

#include <cstdint>
#include <optional>
#include <string>

#include "host/daemon/hand_tracker.h"

namespace torquer::daemon {

/// A lock held until destruction (or the end of the process, however it ends).
class Claim {
 public:
  /// Claims `name`; throws UserError naming `what` and the process that holds it.
  Claim(const std::string& name, const std::string& what);
  ~Claim();
  Claim(const Claim&) = delete;
  Claim& operator=(const Claim&) = delete;

  int file() const { return fd_; }

 private:
  int fd_ = -1;
};

/// The process that holds the claim `name`, if any: by the kernel's word, not the file's. None,
/// too, where the holder is in another process id namespace.
std::optional<int> ClaimHolder(const std::string& name);

/// Sends `signal` to the process that holds the claim `name`, and never to another one, however the
/// claims' files may read and whoever takes a number that has become free. False where nobody holds
/// it, or the holder may not be signaled.
bool SignalClaimHolder(const std::string& name, int signal);

/// Name of the claim on a device, made of its serial number or its path.
std::string DeviceClaimName(const std::string& device);

/// Name of the claim on an instrument on the bus at `lcm_url`, seen from this network namespace.
std::string InstrumentClaimName(const std::string& instrument, const std::string& lcm_url);

/// The command that was published last.
struct LastCommand {
  Pose pose;
  std::int64_t sequence = -1;
  std::int64_t boottime_us = 0;  ///< when; goes on while the machine sleeps
  std::int64_t clock_id = 0;
};

/// The claim on an instrument, and its last command.
class InstrumentClaim {
 public:
  InstrumentClaim(const std::string& instrument, const std::string& lcm_url);
  ~InstrumentClaim();

  /// What the previous daemon published last, if that is known.
  const std::optional<LastCommand>& previous() const { return previous_; }

  /// Stores what was published. A crash at any instant leaves this one or the one before.
  void Remember(const LastCommand& command);

 private:
  struct Record;

  Claim claim_;
  Record* record_ = nullptr;
  std::uint64_t count_ = 0;
  std::optional<LastCommand> previous_;
};

}  // namespace torquer::daemon
