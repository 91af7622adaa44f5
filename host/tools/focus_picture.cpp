#include "host/tools/focus_picture.h"

#include <fmt/format.h>
#include <png.h>

#include <vector>

#include "host/support/error.h"

namespace torquer::tools {
namespace {

using calibration::FocusPicture;
using calibration::kFocusSide;
using calibration::kFocusWhite;

constexpr int kPointsAPixel = 10;

int At(const FocusPicture& picture, int row, int column) {
  return picture[static_cast<std::size_t>(row * kFocusSide + column)];
}

// Color index among the terminal's 24 grays; 232 is the darkest.
int Gray(int brightness) { return 232 + brightness * 23 / kFocusWhite; }

}  // namespace

std::string FocusText(const FocusPicture& picture, bool gray) {
  constexpr std::string_view kRamp = " .:-=+*#%@";
  std::string text;
  for (int row = 0; row < kFocusSide; row += 2) {
    for (int column = 0; column < kFocusSide; ++column) {
      const int upper = At(picture, row, column), lower = At(picture, row + 1, column);
      if (gray) {
        text += fmt::format("\033[38;5;{};48;5;{}m\u2580", Gray(upper), Gray(lower));
      } else {
        const int last = static_cast<int>(kRamp.size()) - 1;
        text += kRamp[static_cast<std::size_t>((upper + lower) * last / (2 * kFocusWhite))];
      }
    }
    text += gray ? "\033[0m\n" : "\n";
  }
  return text;
}

std::string FocusPng(const FocusPicture& picture) {
  constexpr int kSide = kFocusSide * kPointsAPixel;
  std::vector<png_byte> points;
  for (int y = 0; y < kSide; ++y) {
    for (int x = 0; x < kSide; ++x) {
      const int brightness = At(picture, y / kPointsAPixel, x / kPointsAPixel);
      points.push_back(static_cast<png_byte>(brightness * 255 / kFocusWhite));
    }
  }
  png_image image{};
  image.version = PNG_IMAGE_VERSION;
  image.width = image.height = kSide;
  image.format = PNG_FORMAT_GRAY;
  png_alloc_size_t size = PNG_IMAGE_PNG_SIZE_MAX(image);
  std::string file(size, '\0');
  if (png_image_write_to_memory(&image, file.data(), &size, 0, points.data(), 0, nullptr) == 0) {
    throw UserError(fmt::format("the sensor's picture cannot be made a PNG: {}", image.message));
  }
  file.resize(size);
  return file;
}

std::string FocusVerdictText(const calibration::FocusVerdict& verdict, int surface_quality) {
  const calibration::FocusFigures& seen = verdict.figures;
  std::string text = fmt::format(
      "surface {} | brightness {:.0f} % | contrast {:.2f} | sharpness {:.2f} | shading across "
      "{:.2f}, along {:.2f} : 1 | dirt {:.0f} %\n",
      surface_quality, 100 * seen.brightness, seen.contrast, seen.sharpness, seen.shading_across,
      seen.shading_along, 100 * seen.dirt);
  for (const std::string& finding : verdict.findings) text += finding + "\n";
  return text;
}

}  // namespace torquer::tools
