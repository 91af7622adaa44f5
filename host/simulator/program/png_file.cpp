#include "host/simulator/program/png_file.h"

#include <png.h>

#include "host/support/atomic_file.h"
#include "host/support/error.h"

namespace torquer::program {

void WritePng(const std::string& path, const Picture& picture) {
  png_image image{};
  image.version = PNG_IMAGE_VERSION;
  image.width = static_cast<png_uint_32>(picture.width);
  image.height = static_cast<png_uint_32>(picture.height);
  image.format = PNG_FORMAT_GRAY;
  png_alloc_size_t size = PNG_IMAGE_PNG_SIZE_MAX(image);
  std::string bytes(size, '\0');
  if (png_image_write_to_memory(&image, bytes.data(), &size, 0, picture.gray.data(), 0, nullptr) ==
      0) {
    throw UserError(path + ": the picture cannot be made a PNG: " + image.message);
  }
  bytes.resize(size);
  WriteFileAtomically(path, bytes);
}

}  // namespace torquer::program
