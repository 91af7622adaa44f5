// X-ray pictures as JPEG bytes.
#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

#include "host/simulator/effects/effect.h"

namespace torquer::simulator {

struct Jpeg {
  int width = 0;
  int height = 0;
  std::vector<std::uint8_t> bytes;
};

/// Compresses pictures to gray JPEG of a limited size.
class JpegEncoder {
 public:
  /// Compresses a picture to at most `most_bytes` (>= 10,000). The quality, 90 at best, is lowered
  /// until it fits, and is the first one tried for the next picture. If the lowest quality does not
  /// fit, as for white noise, width and height are halved.
  const Jpeg& Encode(const effects::ImageSource::Picture& picture, std::size_t most_bytes);

 private:
  void EncodeAt(const effects::ImageSource::Picture& picture, int quality);

  int quality_ = 90;
  Jpeg jpeg_;
};

}  // namespace torquer::simulator
