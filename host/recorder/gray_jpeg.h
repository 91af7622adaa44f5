// JPEG decoder: gray pictures from untrusted JPEG bytes.
#pragma once

#include <cstdint>
#include <optional>
#include <span>
#include <vector>

namespace torquer {

struct GrayPicture {
  int width = 0;
  int height = 0;
  std::vector<std::uint8_t> pixels;  ///< row by row from the top; 0 is black
};

/// Decodes the picture, or only its size. Returns nullopt if the JPEG is damaged or incomplete, or
/// if a side does not have 16 to 4096 pixels. Colors become gray.
std::optional<GrayPicture> ReadGrayJpeg(std::span<const std::uint8_t> bytes);
std::optional<GrayPicture> ReadGrayJpegSize(std::span<const std::uint8_t> bytes);

/// Scales `picture` to the largest size that fits into `width` x `height` pixels. It is centered on
/// black.
GrayPicture FitInto(const GrayPicture& picture, int width, int height);

}  // namespace torquer
