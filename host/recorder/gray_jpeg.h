// Gray pictures from JPEG bytes of any origin.
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

/// The picture, or only its size; nothing where the bytes are no whole JPEG, or one with a side of
/// less than 16 or more than 4096 pixels. Colors become gray.
std::optional<GrayPicture> ReadGrayJpeg(std::span<const std::uint8_t> bytes);
std::optional<GrayPicture> ReadGrayJpegSize(std::span<const std::uint8_t> bytes);

/// `picture` as large as fits into the middle of `width` x `height` pixels, black around it.
GrayPicture FitInto(const GrayPicture& picture, int width, int height);

}  // namespace torquer
