// Ensures that a bus has only one steering viewer, and no other sender of commands.
#pragma once

#include <string>

#include "host/bus/claim.h"

namespace torquer::viewer {

/// The claim on steering a bus, held until destruction.
class SoleHand {
 public:
  /// Listens for kListenMs. Throws UserError naming the viewer's process that has the claim, or the
  /// commanded instrument and the commanding process.
  explicit SoleHand(const std::string& url);

  /// Time of listening. A daemon sends a command at least ten times a second.
  static constexpr int kListenMs = 400;

 private:
  const bus::Claim claim_;
};

}  // namespace torquer::viewer
