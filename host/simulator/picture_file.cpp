#include "host/simulator/picture_file.h"

#include <png.h>

#include <algorithm>
#include <cassert>
#include <cstdio>
#include <cstdlib>
// After <cstdio>, which it needs and does not include.
#include <jpeglib.h>

#include "host/support/error.h"

namespace torquer::simulator {

void WritePng(const std::string& path, const effects::ImageSource::Picture& picture) {
  png_image image{};
  image.version = PNG_IMAGE_VERSION;
  image.width = static_cast<png_uint_32>(picture.width);
  image.height = static_cast<png_uint_32>(picture.height);
  image.format = PNG_FORMAT_GRAY;
  if (png_image_write_to_file(&image, path.c_str(), 0, picture.gray.data(), 0, nullptr) == 0) {
    throw UserError(path + ": cannot be written (" + image.message +
                    "); check the folder, its permissions and the room on the disk");
  }
}

void JpegEncoder::EncodeAt(const effects::ImageSource::Picture& picture, int quality) {
  jpeg_compress_struct compress{};
  jpeg_error_mgr errors{};
  compress.err = jpeg_std_error(&errors);
  jpeg_create_compress(&compress);
  unsigned char* memory = nullptr;
  unsigned long size = 0;
  jpeg_mem_dest(&compress, &memory, &size);
  compress.image_width = static_cast<JDIMENSION>(picture.width);
  compress.image_height = static_cast<JDIMENSION>(picture.height);
  compress.input_components = 1;
  compress.in_color_space = JCS_GRAYSCALE;
  jpeg_set_defaults(&compress);
  jpeg_set_quality(&compress, quality, TRUE);
  jpeg_start_compress(&compress, TRUE);
  while (compress.next_scanline < compress.image_height) {
    // The library takes no const, and writes nothing.
    auto* row = const_cast<JSAMPLE*>(picture.gray.data()) +
                static_cast<std::size_t>(compress.next_scanline) * compress.image_width;
    jpeg_write_scanlines(&compress, &row, 1);
  }
  jpeg_finish_compress(&compress);
  jpeg_destroy_compress(&compress);
  bytes_.assign(memory, memory + size);
  std::free(memory);
}

const std::vector<std::uint8_t>& JpegEncoder::Encode(const effects::ImageSource::Picture& picture,
                                                     std::size_t most_bytes) {
  constexpr int kBest = 90;
  constexpr int kWorst = 5;
  constexpr int kStep = 5;
  EncodeAt(picture, quality_);
  while (bytes_.size() > most_bytes && quality_ > kWorst) {
    quality_ = std::max(kWorst, quality_ - kStep);
    EncodeAt(picture, quality_);
  }
  assert(bytes_.size() <= most_bytes);
  // With room to spare the next one may be better.
  if (bytes_.size() < most_bytes * 7 / 10) quality_ = std::min(kBest, quality_ + kStep);
  return bytes_;
}

}  // namespace torquer::simulator
