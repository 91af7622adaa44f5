// A bus has one viewer that steers, and none beside a hand that commands already.
#pragma once

#include <string>

#include "host/bus/claim.h"

namespace torquer::viewer {

/// The claim on steering a bus, held until destruction.
class SoleHand {
 public:
  /// Listens for kListenMs. Throws UserError naming the process of the viewer that has the claim,
  /// or the instrument that is commanded and by whom.
  explicit SoleHand(const std::string& url);

  /// A daemon sends a command ten times a second at least.
  static constexpr int kListenMs = 400;

 private:
  const bus::Claim claim_;
};

}  // namespace torquer::viewer
