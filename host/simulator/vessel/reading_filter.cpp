#include "host/simulator/vessel/reading_filter.h"

#include <seccomp.h>
#include <unistd.h>

#include <cerrno>

namespace torquer::vessel {
namespace {

constexpr int kAllowed[] = {
    // the file and the answer
    SCMP_SYS(read), SCMP_SYS(write), SCMP_SYS(writev), SCMP_SYS(close), SCMP_SYS(lseek),
    SCMP_SYS(fstat),
    // memory; the surface is the only open file that could be mapped
    SCMP_SYS(brk), SCMP_SYS(mmap), SCMP_SYS(munmap), SCMP_SYS(mremap), SCMP_SYS(mprotect),
    SCMP_SYS(madvise), SCMP_SYS(getrandom), SCMP_SYS(sysinfo), SCMP_SYS(futex),
    SCMP_SYS(clock_gettime),
    // the end, also by abort()
    SCMP_SYS(exit), SCMP_SYS(exit_group), SCMP_SYS(rt_sigreturn), SCMP_SYS(rt_sigprocmask),
    SCMP_SYS(rt_sigaction), SCMP_SYS(getpid), SCMP_SYS(gettid)};

}  // namespace

bool AllowOnlyReading() {
  // Refused calls do not kill the process: another C library may try another call first.
  const scmp_filter_ctx filter = seccomp_init(SCMP_ACT_ERRNO(EPERM));
  if (filter == nullptr) return false;
  bool made = true;
  for (const int call : kAllowed) {
    made = made && seccomp_rule_add(filter, SCMP_ACT_ALLOW, call, 0) == 0;
  }
  const scmp_arg_cmp itself = SCMP_A0(SCMP_CMP_EQ, static_cast<scmp_datum_t>(getpid()));
  made = made && seccomp_rule_add(filter, SCMP_ACT_ALLOW, SCMP_SYS(tgkill), 1, itself) == 0;
  made = made && seccomp_load(filter) == 0;
  seccomp_release(filter);
  return made;
}

}  // namespace torquer::vessel
