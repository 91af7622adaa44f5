#include "host/support/atomic_file.h"

#include <sys/resource.h>
#include <sys/socket.h>
#include <sys/stat.h>
#include <sys/sysmacros.h>
#include <sys/un.h>
#include <sys/wait.h>
#include <unistd.h>

#include <catch2/catch.hpp>
#include <csignal>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <iterator>

#include "host/support/error.h"
#include "tests/support/file_contents.h"
#include "tests/support/temporary_folder.h"

using Catch::Contains;
using torquer::AtomicFile;
using torquer::UserError;
using torquer::WriteFileAtomically;
using torquer::test::Contents;
using torquer::test::TemporaryFolder;

namespace {

int FilesIn(const TemporaryFolder& folder) {
  return static_cast<int>(std::distance(std::filesystem::directory_iterator(folder.Path()), {}));
}

mode_t ModeOf(const std::string& path) {
  struct stat status {};
  REQUIRE(stat(path.c_str(), &status) == 0);
  return status.st_mode & 07777;
}

// Limits the size of this process's files to `bytes` for its lifetime, like a full disk.
class SizeLimit {
 public:
  explicit SizeLimit(rlim_t bytes) : handler_(std::signal(SIGXFSZ, SIG_IGN)) {
    getrlimit(RLIMIT_FSIZE, &before_);
    const rlimit limit{bytes, before_.rlim_max};
    setrlimit(RLIMIT_FSIZE, &limit);
  }
  ~SizeLimit() {
    setrlimit(RLIMIT_FSIZE, &before_);
    std::signal(SIGXFSZ, handler_);
  }
  SizeLimit(const SizeLimit&) = delete;
  SizeLimit& operator=(const SizeLimit&) = delete;

 private:
  void (*handler_)(int);
  rlimit before_{};
};

}  // namespace

TEST_CASE("A file has its name only once it is finished", "[support]") {
  const TemporaryFolder folder;
  const std::string path = folder.Path("file");
  {
    AtomicFile file(path);
    file.out() << "one " << 2 << std::flush;
    CHECK_FALSE(std::filesystem::exists(path));
    file.Finish();
  }
  CHECK(Contents(path) == "one 2");
  CHECK(FilesIn(folder) == 1);
  {
    AtomicFile abandoned(path);
    abandoned.out() << "three";
    CHECK(Contents(path) == "one 2");
  }
  CHECK(Contents(path) == "one 2");
  CHECK(FilesIn(folder) == 1);
}

TEST_CASE("Any contents are written, at once or in parts", "[support]") {
  const TemporaryFolder folder;
  std::string contents;
  for (unsigned i = 0; i < 300000; ++i) contents += static_cast<char>(i * 7919 >> 3);
  WriteFileAtomically(folder.Path("at_once"), contents);
  CHECK(Contents(folder.Path("at_once")) == contents);
  AtomicFile parts(folder.Path("parts"));
  for (std::size_t i = 0; i < contents.size(); i += 1 + i % 977) {
    parts.out().write(&contents[i],
                      static_cast<std::streamsize>(std::min(1 + i % 977, contents.size() - i)));
  }
  parts.Finish();
  CHECK(Contents(folder.Path("parts")) == contents);
  WriteFileAtomically(folder.Path("empty"), "");
  CHECK(std::filesystem::file_size(folder.Path("empty")) == 0);
}

TEST_CASE("A target that is not an ordinary file is refused and left unchanged", "[support]") {
  const TemporaryFolder folder;
  const std::string path = folder.Path("target");
  std::string kind;
  SECTION("a folder") {
    kind = "a folder";
    std::filesystem::create_directory(path);
  }
  SECTION("a pipe") {
    kind = "a pipe";
    REQUIRE(mkfifo(path.c_str(), 0600) == 0);
  }
  SECTION("a socket") {
    kind = "a socket";
    const int fd = socket(AF_UNIX, SOCK_STREAM | SOCK_CLOEXEC, 0);
    sockaddr_un address{};
    address.sun_family = AF_UNIX;
    std::strncpy(address.sun_path, path.c_str(), sizeof address.sun_path - 1);
    REQUIRE(bind(fd, reinterpret_cast<const sockaddr*>(&address), sizeof address) == 0);
    close(fd);
  }
  SECTION("a device") {
    kind = "a device";
    // The test's own device node: with a real one, a mistake would replace it for the whole
    // machine.
    if (mknod(path.c_str(), S_IFCHR | 0666, makedev(1, 3)) != 0) {
      WARN("only root can make a device: not tested");
      return;
    }
  }
  const auto type = std::filesystem::status(path).type();
  CHECK_THROWS_WITH(WriteFileAtomically(path, "x"),
                    Contains(path + ": cannot be written: it is " + kind));
  CHECK(std::filesystem::status(path).type() == type);
  CHECK(FilesIn(folder) == 1);
  // The same through a symbolic link.
  std::filesystem::create_symlink("target", folder.Path("link"));
  CHECK_THROWS_WITH(WriteFileAtomically(folder.Path("link"), "x"), Contains("it is " + kind));
  CHECK(std::filesystem::status(path).type() == type);
  CHECK(FilesIn(folder) == 2);
}

TEST_CASE("The file behind a symbolic link is written, and the link stays", "[support]") {
  const TemporaryFolder folder;
  std::filesystem::create_directory(folder.Path("elsewhere"));
  const std::string target = folder.Path("elsewhere/file");
  const auto link = [&](const std::string& to, const std::string& name) {
    std::filesystem::create_symlink(to, folder.Path(name));
    return folder.Path(name);
  };
  const std::string relative = link("elsewhere/file", "relative");
  const std::string absolute = link(target, "absolute");
  const std::string chained = link("relative", "chained");
  WriteFileAtomically(relative, "made");  // it did not exist
  CHECK(Contents(target) == "made");
  WriteFileAtomically(absolute, "again");
  CHECK(Contents(target) == "again");
  WriteFileAtomically(chained, "and again");
  CHECK(Contents(target) == "and again");
  for (const std::string& each : {relative, absolute, chained}) {
    CHECK(std::filesystem::is_symlink(each));
  }
  CHECK_FALSE(std::filesystem::is_symlink(target));
  CHECK(std::distance(std::filesystem::directory_iterator(folder.Path("elsewhere")), {}) == 1);

  link("loop_b", "loop_a");
  link("loop_a", "loop_b");
  CHECK_THROWS_WITH(WriteFileAtomically(folder.Path("loop_a"), "x"), Contains("form a loop"));
  CHECK(FilesIn(folder) == 6);
}

TEST_CASE("A path at which there can be no file is refused with the reason", "[support]") {
  const TemporaryFolder folder;
  CHECK_THROWS_WITH(WriteFileAtomically(folder.Path("no/such/folder"), "x"),
                    Contains("no/such/folder: cannot be written: No such file or directory"));
  CHECK_THROWS_WITH(WriteFileAtomically("", "x"), Contains("names no file"));
  CHECK_THROWS_WITH(WriteFileAtomically(folder.Path() + "/", "x"), Contains("names no file"));
  CHECK_THROWS_WITH(WriteFileAtomically(folder.Path() + "/..", "x"), Contains("a folder"));
  CHECK_THROWS_WITH(WriteFileAtomically(folder.Path(std::string(300, 'x')), "x"),
                    Contains("File name too long"));
  // Fails before anything is written.
  CHECK_THROWS_AS(AtomicFile(folder.Path(std::string(300, 'x'))), UserError);
  CHECK(FilesIn(folder) == 0);
  // The longest name that the file system allows is accepted here too.
  WriteFileAtomically(folder.Path(std::string(255, 'x')), "x");
  CHECK(FilesIn(folder) == 1);
}

TEST_CASE("A full disk leaves only the old file", "[support]") {
  const TemporaryFolder folder;
  const std::string path = folder.Path("file");
  WriteFileAtomically(path, "old");
  const std::string large(200000, 'x');
  {
    const SizeLimit full(100000);
    CHECK_THROWS_WITH(WriteFileAtomically(path, large), Contains(path + ": cannot be written: "));
    AtomicFile file(path);
    file.out() << large << std::flush;
    CHECK_FALSE(file.out().good());
    CHECK_THROWS_AS(file.Finish(), UserError);
    // The failure may come only with the last bytes, which are still in memory.
    AtomicFile last(path);
    last.out() << large.substr(0, 99000) << std::flush << large.substr(0, 5000);
    CHECK(last.out().good());
    CHECK_THROWS_AS(last.Finish(), UserError);
  }
  CHECK(Contents(path) == "old");
  CHECK(FilesIn(folder) == 1);
}

TEST_CASE("A full disk keeps the data so far beside the old file", "[support]") {
  const TemporaryFolder folder;
  const std::string path = folder.Path("file");
  const std::string row(999, 'x');
  WriteFileAtomically(path, "old");
  for (const bool then_more : {false, true}) {
    const SizeLimit full(100'500);
    AtomicFile file(path);
    int rows = 0;
    while (rows < 300) {
      file.out() << row << '\n';
      ++rows;
      if (!file.KeepSoFar() && !then_more) break;
    }
    CHECK((rows < 300) == !then_more);  // detected during writing
    CHECK_THROWS_WITH(file.Finish(), Contains("File too large") &&
                                         Contains("its first 100000 bytes") &&
                                         Contains("file.partial"));
    CHECK(std::filesystem::file_size(folder.Path("file.partial")) == 100'000);
    CHECK(Contents(path) == "old");
    CHECK(FilesIn(folder) == 2);
  }
  CHECK(Contents(folder.Path("file.partial")).ends_with("x\n"));
}

TEST_CASE("Room that is set aside is there when the disk is full", "[support]") {
  const TemporaryFolder folder;
  const std::string path = folder.Path("file");
  {
    const SizeLimit full(1000);
    AtomicFile file(path);
    CHECK_THROWS_WITH(file.Reserve(2000), Contains("File too large"));
  }
  AtomicFile file(path);
  file.Reserve(50'000);
  file.out() << "short";
  file.Finish();
  CHECK(Contents(path) == "short");  // not the saved copy
}

TEST_CASE("A process that is killed leaves no file", "[support]") {
  const TemporaryFolder folder;
  const pid_t child = fork();
  REQUIRE(child >= 0);
  if (child == 0) {
    AtomicFile file(folder.Path("file"));
    file.out() << "half" << std::flush;
    kill(getpid(), SIGKILL);
  }
  int status = 0;
  REQUIRE(waitpid(child, &status, 0) == child);
  REQUIRE(WIFSIGNALED(status));
  CHECK(FilesIn(folder) == 0);
}

TEST_CASE("A replaced file keeps its permissions, a new one follows the umask", "[support]") {
  const TemporaryFolder folder;
  const mode_t before = umask(027);
  WriteFileAtomically(folder.Path("new"), "x");
  umask(before);
  CHECK(ModeOf(folder.Path("new")) == 0640);
  std::ofstream(folder.Path("old")) << "x";
  chmod(folder.Path("old").c_str(), 0604);
  WriteFileAtomically(folder.Path("old"), "y");
  CHECK(ModeOf(folder.Path("old")) == 0604);
}

TEST_CASE("Remains of a killed process are neither used nor removed", "[support]") {
  const TemporaryFolder folder;
  const std::string path = folder.Path("file");
  // Temporary names that this process would use next.
  for (int i = 1; i < 200; ++i) {
    std::ofstream(
        folder.Path(".torquer-" + std::to_string(getpid()) + "-" + std::to_string(i) + ".tmp"))
        << "left";
  }
  WriteFileAtomically(path, "new");
  CHECK(Contents(path) == "new");
  CHECK(FilesIn(folder) == 200);
}

TEST_CASE("Two writers of one file do not meet", "[support]") {
  const TemporaryFolder folder;
  const std::string path = folder.Path("file");
  AtomicFile a(path);
  AtomicFile b(path);
  a.out() << "a";
  b.out() << "b";
  b.Finish();
  CHECK(Contents(path) == "b");
  a.Finish();
  CHECK(Contents(path) == "a");
  CHECK(FilesIn(folder) == 1);
}
