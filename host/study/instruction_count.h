// Instruction counts of ticks, measured by callgrind.
#pragma once

#include <string>
#include <vector>

namespace torquer::study {

struct InstructionCounts {
  std::vector<double> per_tick;  ///< mean over the feeds of each scene; empty if counting failed
  std::string problem;           ///< reason for the failure, in a sentence; "" on success
};

/// Runs torquer-effect-ticks from this program's folder under valgrind: `feeds` ticks of
/// EffectDrive in each scene. With `quick` the wire is 100 mm long. Output files of both programs
/// go to `folder`.
InstructionCounts CountInstructions(const std::vector<std::string>& scenes, int feeds, bool quick,
                                    const std::string& folder);

}  // namespace torquer::study
