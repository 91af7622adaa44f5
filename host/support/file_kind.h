// File kind in words, for messages.
#pragma once

#include <sys/stat.h>

namespace torquer {

/// "a folder", "a device", "a pipe" and so on, by the st_mode of a file that is no ordinary file.
inline const char* FileKind(mode_t mode) {
  switch (mode & S_IFMT) {
    case S_IFDIR:
      return "a folder";
    case S_IFCHR:
    case S_IFBLK:
      return "a device";
    case S_IFIFO:
      return "a pipe";
    case S_IFSOCK:
      return "a socket";
    default:
      return "not an ordinary file";
  }
}

}  // namespace torquer
