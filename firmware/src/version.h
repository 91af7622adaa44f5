// Version of the firmware, as in the identity report and the USB device descriptor.
#pragma once

#include <stdint.h>

namespace torquer {
namespace firmware {

constexpr uint8_t kVersionMajor = 0;
constexpr uint8_t kVersionMinor = 1;
constexpr uint8_t kVersionPatch = 0;

}  // namespace firmware
}  // namespace torquer
