// Random scenes: scene files with instruments, layouts and effects drawn by chance.
#pragma once

#include <random>
#include <string>

namespace torquer::study {

/// Text of a scene file: a bent, branching vessel of tubes, one to four instruments, and any
/// effects. Instruments share a curve, have room in lumens, or lie beside each other, with and
/// without torsion. The scene reader accepts each text.
std::string RandomScene(std::mt19937& random);

}  // namespace torquer::study
