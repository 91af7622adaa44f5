// Claims, so that nobody is a second time what there may be once: the daemon of an instrument or a
// device, the simulator of a bus, the viewer that steers.
//
// Claims are locked files in $XDG_RUNTIME_DIR/torquer (without that variable in a private folder
// under /tmp). What is claimed on a bus is claimed for one LCM URL in one network namespace.
#pragma once

#include <sys/types.h>

#include <optional>
#include <string>

namespace torquer::bus {

/// Names a claim and its holder in the message that refuses another one.
struct ClaimWords {
  std::string what;                        ///< "the instrument 'guidewire'"
  std::string program = "torquer-daemon";  ///< that claims such things
  std::string detail = {};                 ///< what this holder does, "scene neuro_arch"
};

/// A lock held until destruction (or the end of the process, however it ends).
class Claim {
 public:
  /// Claims `name`; throws UserError naming what it is on and the process that holds it.
  Claim(const std::string& name, const ClaimWords& words);
  ~Claim();
  Claim(const Claim&) = delete;
  Claim& operator=(const Claim&) = delete;

  int file() const { return fd_; }

  /// Claims begin with a line about the holder; a record may follow.
  static constexpr off_t kRecordOffset = 64;

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

/// The file of the claim `name`.
std::string ClaimPath(const std::string& name);

/// Removes claims that nobody holds and that were not used for a day.
void RemoveStaleClaims();

/// A claim's name: of its kind, of what a person may read in it, and of what tells it from others.
std::string ClaimName(const std::string& kind, const std::string& readable,
                      const std::string& identity);

/// Name of the claim on a `kind` of thing on the bus at `lcm_url`, seen from this network
/// namespace.
std::string BusClaimName(const std::string& kind, const std::string& thing,
                         const std::string& lcm_url);

}  // namespace torquer::bus
