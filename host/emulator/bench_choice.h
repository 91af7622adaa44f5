// The emulated device on a command line: the options that both emulator programs have.
#pragma once

#include <string>

#include "host/emulator/bench_device.h"
#include "host/support/program.h"

namespace torquer::emulator {

/// Command-line options of the emulated device.
struct BenchChoice {
  std::string firmware;    ///< ELF file; "" after Complete(): none, the flash holds no application
  std::string bootloader;  ///< ELF file; "": none
  double misalignment_deg = 0.0;
  std::string sensor = "pmw3360";  ///< or pmw3389
  BenchOptions options;

  /// Fills in what follows from the options given: the firmware of this build unless another is
  /// named. Throws UsageError if no device would run.
  void Complete();
};

/// Declares the options, which set `choice`.
void AddBenchOptions(Options& options, BenchChoice& choice);

}  // namespace torquer::emulator
