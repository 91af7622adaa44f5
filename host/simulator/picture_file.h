// X-ray pictures as PNG files and as JPEG bytes.
#pragma once

#include <cstddef>
#include <cstdint>
#include <string>
#include <vector>

#include "host/simulator/effects/effect.h"

namespace torquer::simulator {

/// Writes a gray PNG. Throws UserError naming the path.
void WritePng(const std::string& path, const effects::ImageSource::Picture& picture);

/// Compresses pictures to gray JPEG of a limited size.
class JpegEncoder {
 public:
  /// The bytes of a picture, at most `most_bytes`: the quality, 90 at best, is lowered until they
  /// fit, and kept in mind for the next picture.
  const std::vector<std::uint8_t>& Encode(const effects::ImageSource::Picture& picture,
                                          std::size_t most_bytes);

 private:
  void EncodeAt(const effects::ImageSource::Picture& picture, int quality);

  int quality_ = 90;
  std::vector<std::uint8_t> bytes_;
};

}  // namespace torquer::simulator
