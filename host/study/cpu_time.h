// Processor time of the calling thread. The studies use it because it excludes time that other
// programs take.
#pragma once

#include <time.h>

namespace torquer::study {

/// Seconds of processor time that the calling thread has used (CLOCK_THREAD_CPUTIME_ID).
inline double ThreadCpuSeconds() {
  timespec now{};
  clock_gettime(CLOCK_THREAD_CPUTIME_ID, &now);
  return static_cast<double>(now.tv_sec) + 1e-9 * static_cast<double>(now.tv_nsec);
}

}  // namespace torquer::study
