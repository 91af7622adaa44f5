// Replacement of firmware/src/version.h for the image that the tests update to.
#pragma once

#include <stdint.h>

namespace torquer {
namespace firmware {

constexpr uint8_t kVersionMajor = 0;
constexpr uint8_t kVersionMinor = 15;
constexpr uint8_t kVersionPatch = 2;

}  // namespace firmware
}  // namespace torquer
