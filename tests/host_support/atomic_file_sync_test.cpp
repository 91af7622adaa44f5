// System calls of an AtomicFile and their order. This program's fsync() and rename() replace those
// of the C library. They record the call and pass it on.
#include <fcntl.h>
#include <sys/stat.h>
#include <sys/syscall.h>
#include <unistd.h>

#include <catch2/catch.hpp>
#include <cerrno>
#include <string>
#include <vector>

#include "host/support/atomic_file.h"
#include "host/support/error.h"
#include "tests/support/temporary_folder.h"

namespace {

std::vector<std::string>& Calls() {
  static std::vector<std::string> calls;
  return calls;
}
bool failing_sync_of_file = false;
bool failing_rename = false;

}  // namespace

extern "C" int fsync(int fd) {
  struct stat status {};
  fstat(fd, &status);
  const bool folder = S_ISDIR(status.st_mode);
  Calls().emplace_back(folder ? "sync folder" : "sync file of " + std::to_string(status.st_size));
  if (!folder && failing_sync_of_file) {
    errno = EIO;
    return -1;
  }
  return static_cast<int>(syscall(SYS_fsync, fd));
}

extern "C" int rename(const char* from, const char* to) noexcept {
  Calls().emplace_back("rename");
  if (failing_rename) {
    errno = EIO;
    return -1;
  }
  return static_cast<int>(syscall(SYS_rename, from, to));
}

TEST_CASE("A file is on the disk before it has its name, and then the name is", "[support]") {
  const torquer::test::TemporaryFolder folder;
  Calls().clear();
  torquer::WriteFileAtomically(folder.Path("file"), "12345");
  CHECK(Calls() == std::vector<std::string>{"sync file of 5", "rename", "sync folder"});
}

TEST_CASE("A file that cannot be synced or renamed is not there", "[support]") {
  const torquer::test::TemporaryFolder folder;
  (GENERATE(true, false) ? failing_sync_of_file : failing_rename) = true;
  Calls().clear();
  CHECK_THROWS_WITH(torquer::WriteFileAtomically(folder.Path("file"), "12345"),
                    Catch::Contains("Input/output error"));
  const bool renamed = !failing_sync_of_file;
  failing_sync_of_file = failing_rename = false;
  CHECK(Calls().size() == (renamed ? 2 : 1));
  CHECK(std::filesystem::is_empty(folder.Path()));
}
