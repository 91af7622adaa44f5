// Claims: locks that allow one holder at a time. Claims exist for the daemon of an instrument or a
// device, a bus's simulator, and the viewer that steers.
//
// Claims are locked files in $XDG_RUNTIME_DIR/torquer (without that variable in a private folder
// under /tmp). A claim on a bus holds for one LCM URL in one network namespace.
#pragma once

#include <sys/types.h>

#include <optional>
#include <string>

namespace torquer::bus {

/// Names a claim and its holder in the message that refuses another one.
struct ClaimWords {
  std::string what;                        ///< "the instrument 'guidewire'"
  std::string program = "torquer-daemon";  ///< the program that takes this kind of claim
  std::string detail = {};                 ///< the holder's activity, such as "scene neuro_arch"
};

/// A lock held until destruction (or the end of the process, however it ends).
class Claim {
 public:
  /// Claims `name`; throws UserError naming the claimed thing and the process that holds it.
  Claim(const std::string& name, const ClaimWords& words);
  ~Claim();
  Claim(const Claim&) = delete;
  Claim& operator=(const Claim&) = delete;

  int file() const { return fd_; }

  /// Offset of the record in the file, bytes. A claim begins with a line about the holder; a record
  /// may follow.
  static constexpr off_t kRecordOffset = 64;

 private:
  int fd_ = -1;
};

/// PID of the process that holds the claim `name`, if any, as reported by the kernel, not the file.
/// Also nullopt if the holder is in another PID namespace.
std::optional<int> ClaimHolder(const std::string& name);

/// Sends `signal` to the process that holds the claim `name`. No other process is ever signaled,
/// even if the claim's file is wrong or a PID has been reused. False if no other process holds the
/// claim, or the holder may not be signaled.
bool SignalClaimHolder(const std::string& name, int signal);

/// The file of the claim `name`.
std::string ClaimPath(const std::string& name);

/// Removes claims without a holder that have not been used for a day.
void RemoveStaleClaims();

/// Name of a claim: its `kind`, a readable part, and a hash of `identity`, which distinguishes it
/// from others.
std::string ClaimName(const std::string& kind, const std::string& readable,
                      const std::string& identity);

/// Name of the claim on a `kind` of thing on the bus at `lcm_url`, seen from this network
/// namespace.
std::string BusClaimName(const std::string& kind, const std::string& thing,
                         const std::string& lcm_url);

}  // namespace torquer::bus
