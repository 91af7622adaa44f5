#include "host/simulator/jpeg_encoder.h"

#include <algorithm>
#include <cstdio>
#include <cstdlib>
// jpeglib.h needs <cstdio> and does not include it.
#include <jpeglib.h>

namespace torquer::simulator {

namespace {

using Picture = effects::ImageSource::Picture;

// Half the size; each pixel is the mean of four.
Picture Halved(const Picture& picture) {
  Picture half;
  half.width = picture.width / 2;
  half.height = picture.height / 2;
  for (int row = 0; row < half.height; ++row) {
    const std::uint8_t* const above =
        &picture.gray[static_cast<std::size_t>(2 * row) * static_cast<std::size_t>(picture.width)];
    const std::uint8_t* const below = above + picture.width;
    for (int c = 0; c < 2 * half.width; c += 2) {
      half.gray.push_back(
          static_cast<std::uint8_t>((above[c] + above[c + 1] + below[c] + below[c + 1] + 2) / 4));
    }
  }
  return half;
}

}  // namespace

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
    // The library takes no pointer to const, but does not write.
    auto* row = const_cast<JSAMPLE*>(picture.gray.data()) +
                static_cast<std::size_t>(compress.next_scanline) * compress.image_width;
    jpeg_write_scanlines(&compress, &row, 1);
  }
  jpeg_finish_compress(&compress);
  jpeg_destroy_compress(&compress);
  jpeg_.width = picture.width;
  jpeg_.height = picture.height;
  jpeg_.bytes.assign(memory, memory + size);
  std::free(memory);
}

const Jpeg& JpegEncoder::Encode(const effects::ImageSource::Picture& picture,
                                std::size_t most_bytes) {
  constexpr int kBest = 90;
  constexpr int kWorst = 5;
  constexpr int kStep = 5;
  EncodeAt(picture, quality_);
  while (jpeg_.bytes.size() > most_bytes && quality_ > kWorst) {
    quality_ = std::max(kWorst, quality_ - kStep);
    EncodeAt(picture, quality_);
  }
  if (jpeg_.bytes.size() > most_bytes && picture.width > 1 && picture.height > 1) {
    return Encode(Halved(picture), most_bytes);
  }
  // Well below the limit the next picture may have a better quality.
  if (jpeg_.bytes.size() < most_bytes * 7 / 10) quality_ = std::min(kBest, quality_ + kStep);
  return jpeg_;
}

}  // namespace torquer::simulator
