// Boot id: a number that differs from that of the previous boot, so that the host detects every
// reset.
#pragma once

#include <stdint.h>

namespace torquer {
namespace firmware {

/// Call once at the start. The upper five bits count power-ons. They are in one EEPROM cell,
/// written once per power-on; the cell lasts 100,000 writes. The lower three bits count the resets
/// since then, in memory that a reset does not change.
uint8_t NextBootId();

}  // namespace firmware
}  // namespace torquer
