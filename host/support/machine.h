// Description of the machine on which a figure was measured.
#pragma once

#include <fstream>
#include <string>

namespace torquer {

/// Processor, compiler and instruction set, for every published figure: one line.
inline std::string DescribeMachine() {
  std::string processor = "unknown processor";
  std::ifstream file("/proc/cpuinfo");
  for (std::string line; std::getline(file, line);) {
    if (!line.starts_with("model name")) continue;
    processor = line.substr(line.find(':') + 2);
    break;
  }
#if defined(__AVX512F__)
  const std::string set = "AVX-512";
#elif defined(__AVX2__)
  const std::string set = "x86-64-v3";
#elif defined(__SSE4_2__)
  const std::string set = "x86-64-v2";
#else
  const std::string set = "baseline instruction set";
#endif
#ifdef NDEBUG
  const std::string kind = "";
#else
  const std::string kind = ", with assertions";
#endif
  return "One thread of " + processor + ", " + set + kind + ", compiler " __VERSION__ +
         "; thread processor time";
}

}  // namespace torquer
