// The sensor vendor's firmware (SROM), an optional build input: it is the vendor's property and not
// part of this project. The build makes the definitions from the file that TORQUER_PMW3360_SROM
// names; without one, kSromImageBytes is 0 and the sensor runs from its ROM.
#pragma once

#include <stdint.h>

namespace torquer {
namespace firmware {

extern const uint8_t kSromImage[];  // in flash
extern const uint16_t kSromImageBytes;

}  // namespace firmware
}  // namespace torquer
