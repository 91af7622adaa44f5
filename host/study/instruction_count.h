// How many instructions ticks take, counted by callgrind.
#pragma once

#include <string>
#include <vector>

namespace torquer::study {

struct InstructionCounts {
  std::vector<double> per_tick;  ///< mean over the feeds of each scene; empty when not counted
  std::string problem;           ///< why not, in a sentence; "" when counted
};

/// Runs torquer-effect-ticks, which stands beside this program, under valgrind: `feeds` ticks of
/// EffectDrive in each scene, of a wire of 100 mm when `quick`. `folder` takes what the two write.
InstructionCounts CountInstructions(const std::vector<std::string>& scenes, int feeds, bool quick,
                                    const std::string& folder);

}  // namespace torquer::study
