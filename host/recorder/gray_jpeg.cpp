#include "host/recorder/gray_jpeg.h"

#include <csetjmp>
#include <cstddef>
#include <cstdio>
// Must follow cstdio, because it uses FILE.
#include <jpeglib.h>

#include <algorithm>

namespace torquer {
namespace {

constexpr unsigned kLeastSide = 16;
constexpr unsigned kMostSide = 4096;

struct Errors {
  jpeg_error_mgr manager;  // first: the library knows the address of this
  std::jmp_buf back;
};

void Leave(j_common_ptr jpeg) { std::longjmp(reinterpret_cast<Errors*>(jpeg->err)->back, 1); }

void SayNothing(j_common_ptr) {}

// longjmp skips destructors, so this function has no object that needs one.
bool Read(std::span<const std::uint8_t> bytes, bool size_only, GrayPicture& picture) {
  Errors errors;
  jpeg_decompress_struct jpeg;
  jpeg.err = jpeg_std_error(&errors.manager);
  errors.manager.error_exit = Leave;
  errors.manager.output_message = SayNothing;
  if (setjmp(errors.back) != 0) {
    jpeg_destroy_decompress(&jpeg);
    return false;
  }
  jpeg_create_decompress(&jpeg);
  jpeg_mem_src(&jpeg, bytes.data(), bytes.size());
  jpeg_read_header(&jpeg, TRUE);
  const bool usable = std::min(jpeg.image_width, jpeg.image_height) >= kLeastSide &&
                      std::max(jpeg.image_width, jpeg.image_height) <= kMostSide;
  if (usable) {
    picture.width = static_cast<int>(jpeg.image_width);
    picture.height = static_cast<int>(jpeg.image_height);
  }
  if (usable && !size_only) {
    picture.pixels.resize(static_cast<std::size_t>(picture.width) *
                          static_cast<std::size_t>(picture.height));
    jpeg.out_color_space = JCS_GRAYSCALE;
    jpeg_start_decompress(&jpeg);
    while (jpeg.output_scanline < jpeg.output_height) {
      JSAMPROW row =
          picture.pixels.data() + static_cast<std::size_t>(jpeg.output_scanline) * jpeg.image_width;
      jpeg_read_scanlines(&jpeg, &row, 1);
    }
    jpeg_finish_decompress(&jpeg);
  }
  // The library fills in missing bytes with a warning.
  const bool whole = errors.manager.num_warnings == 0;
  jpeg_destroy_decompress(&jpeg);
  return usable && whole;
}

std::optional<GrayPicture> ReadPicture(std::span<const std::uint8_t> bytes, bool size_only) {
  GrayPicture picture;
  // The library terminates the program if the input is empty.
  if (bytes.empty() || !Read(bytes, size_only, picture)) return {};
  return picture;
}

}  // namespace

std::optional<GrayPicture> ReadGrayJpeg(std::span<const std::uint8_t> bytes) {
  return ReadPicture(bytes, false);
}

std::optional<GrayPicture> ReadGrayJpegSize(std::span<const std::uint8_t> bytes) {
  return ReadPicture(bytes, true);
}

GrayPicture FitInto(const GrayPicture& picture, int width, int height) {
  if (picture.width == width && picture.height == height) return picture;
  GrayPicture fitted{width, height, {}};
  fitted.pixels.resize(static_cast<std::size_t>(width) * static_cast<std::size_t>(height));
  const double scale = std::min(static_cast<double>(width) / picture.width,
                                static_cast<double>(height) / picture.height);
  const int shown_width = std::min(width, static_cast<int>(scale * picture.width));
  const int shown_height = std::min(height, static_cast<int>(scale * picture.height));
  const int left = (width - shown_width) / 2;
  const int top = (height - shown_height) / 2;
  for (int y = 0; y < shown_height; ++y) {
    const int from_y = std::min(picture.height - 1, static_cast<int>(y / scale));
    for (int x = 0; x < shown_width; ++x) {
      const int from_x = std::min(picture.width - 1, static_cast<int>(x / scale));
      const auto to = static_cast<std::size_t>(top + y) * static_cast<std::size_t>(width) +
                      static_cast<std::size_t>(left + x);
      fitted.pixels[to] =
          picture
              .pixels[static_cast<std::size_t>(from_y) * static_cast<std::size_t>(picture.width) +
                      static_cast<std::size_t>(from_x)];
    }
  }
  return fitted;
}

}  // namespace torquer
