// A number that differs between a boot and the one before, so that no reset goes unseen.
#pragma once

#include <stdint.h>

namespace torquer {
namespace firmware {

/// To be called once at the start. The upper five bits count power-ons and are kept in one EEPROM
/// cell, written once a power-on (the cell is good for 100,000 of them); the lower three count the
/// resets in between, in memory that a reset leaves alone, and cost no wear.
uint8_t NextBootId();

}  // namespace firmware
}  // namespace torquer
