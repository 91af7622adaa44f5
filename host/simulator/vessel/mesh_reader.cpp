// torquer-mesh-reader FILE MM_PER_UNIT MEMORY_BYTES CPU_S: reads a surface from standard input and
// answers on standard output (mesh_answer.h). Only ImportMesh (mesh_import.h) starts it.
//
// FILE names the surface in messages. A damaged file can harm this process, but no other.
#include <fcntl.h>
#include <signal.h>
#include <sys/prctl.h>
#include <sys/resource.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cstdlib>
#include <exception>
#include <string>

#include "host/simulator/vessel/mesh_answer.h"
#include "host/simulator/vessel/mesh_file.h"
#include "host/simulator/vessel/reading_filter.h"
#include "host/support/error.h"

namespace {

// Only a privileged process can raise a limit that holds already. The grace takes no more than half
// of what is left.
void Limit(int resource, rlim_t most, rlim_t grace = 0) {
  const auto which = static_cast<__rlimit_resource>(resource);
  rlimit limit{};
  if (getrlimit(which, &limit) != 0) std::exit(1);
  limit.rlim_max = std::min(limit.rlim_max, most + grace);
  limit.rlim_cur = limit.rlim_max - std::min(limit.rlim_max / 2, grace);
  if (setrlimit(which, &limit) != 0) std::exit(1);
}

// Called before the first byte of the file is read.
void EnterLimits(rlim_t memory_bytes, rlim_t cpu_s) {
#if !defined(__SANITIZE_ADDRESS__) && !defined(__SANITIZE_THREAD__)
  // Not with sanitizers: they reserve terabytes and open pipes, and their reports must stay
  // visible.
  Limit(RLIMIT_AS, memory_bytes);
  const int nowhere = open("/dev/null", O_WRONLY | O_CLOEXEC);
  if (nowhere >= 0) dup2(nowhere, STDERR_FILENO);
  Limit(RLIMIT_NOFILE, 3);  // no file can be opened any more
#else
  static_cast<void>(memory_bytes);
#endif
  prctl(PR_SET_PDEATHSIG, SIGKILL);
  prctl(PR_SET_NO_NEW_PRIVS, 1, 0, 0, 0);
  prctl(PR_SET_DUMPABLE, 0);
  Limit(RLIMIT_CORE, 0);
  Limit(RLIMIT_CPU, cpu_s, 1);  // SIGXCPU, then SIGKILL
  Limit(RLIMIT_FSIZE, 0);       // the answer goes into a pipe
#if !defined(__SANITIZE_ADDRESS__) && !defined(__SANITIZE_THREAD__)
  torquer::vessel::AllowOnlyReading();  // if the kernel supports it; the limits hold anyway
#endif
}

std::string ReadAll() {
  std::string bytes;
  char buffer[1 << 16];
  for (;;) {
    const ssize_t got = read(STDIN_FILENO, buffer, sizeof buffer);
    if (got < 0 && errno == EINTR) continue;
    if (got < 0) std::exit(1);
    if (got == 0) return bytes;
    bytes.append(buffer, static_cast<std::size_t>(got));
  }
}

void WriteAll(const std::string& bytes) {
  for (std::size_t done = 0; done < bytes.size();) {
    const ssize_t put = write(STDOUT_FILENO, bytes.data() + done, bytes.size() - done);
    if (put < 0 && errno == EINTR) continue;
    if (put <= 0) std::exit(1);
    done += static_cast<std::size_t>(put);
  }
}

std::string Answer(const std::string& path, double mm_per_unit) {
  try {
    return torquer::vessel::MeshAnswer(torquer::vessel::ParseMesh(ReadAll(), path, mm_per_unit));
  } catch (const torquer::UserError& error) {
    return torquer::vessel::RefusalAnswer(error.what());
  } catch (const std::exception& error) {
    return torquer::vessel::RefusalAnswer(path + ": cannot be read as a surface (" + error.what() +
                                          "); the file is damaged: export it again");
  }
}

}  // namespace

int main(int argc, char** argv) {
  if (argc != 5) return 2;
  EnterLimits(std::strtoull(argv[3], nullptr, 10), std::strtoull(argv[4], nullptr, 10));
  WriteAll(Answer(argv[1], std::strtod(argv[2], nullptr)));
  _exit(0);  // skips destructors: the file may have damaged the heap
}
