#include "host/support/input_file.h"

#include <sys/stat.h>

#include <catch2/catch.hpp>
#include <filesystem>
#include <fstream>

#include "host/support/error.h"
#include "tests/support/temporary_folder.h"

using Catch::Contains;
using torquer::ReadInputFile;
using torquer::test::TemporaryFolder;

TEST_CASE("An ordinary file is read whole, of any size", "[support]") {
  const TemporaryFolder folder;
  for (const std::size_t size : {0, 1, 4095, 4096, 4097, 300'000}) {
    std::string contents;
    for (std::size_t i = 0; i < size; ++i) contents += static_cast<char>(i * 7919 >> 3);
    std::ofstream(folder.Path("file"), std::ios::binary) << contents;
    CHECK(ReadInputFile(folder.Path("file"), "") == contents);
  }
  CHECK_THROWS_WITH(ReadInputFile(folder.Path("file"), "give less", 299'999),
                    Contains("has 300000 bytes, and at most 299999 are read; give less"));
  CHECK(ReadInputFile(folder.Path("file"), "", 300'000).size() == 300'000);
  // The kernel reports no size for its own files.
  CHECK_THAT(ReadInputFile("/proc/self/status", ""), Contains("Pid:"));
}

TEST_CASE("A path that is not an ordinary file is refused at once", "[support]") {
  const TemporaryFolder folder;
  REQUIRE(mkfifo(folder.Path("pipe").c_str(), 0600) == 0);
  std::filesystem::create_symlink("pipe", folder.Path("link"));
  CHECK_THROWS_WITH(ReadInputFile(folder.Path("pipe"), "give a file"),
                    Contains("pipe: cannot be read: it is a pipe; give a file"));
  CHECK_THROWS_WITH(ReadInputFile(folder.Path("link"), "give a file"), Contains("it is a pipe"));
  CHECK_THROWS_WITH(ReadInputFile(folder.Path(), "give a file"), Contains("it is a folder"));
  CHECK_THROWS_WITH(ReadInputFile("/dev/zero", "give a file"), Contains("it is a device"));
  CHECK_THROWS_WITH(ReadInputFile(folder.Path("none"), "give a file"),
                    Contains("none: cannot be read: No such file or directory; give a file"));
  CHECK_THROWS_WITH(ReadInputFile(folder.Path(std::string(300, 'x')), "give a file"),
                    Contains("File name too long"));
}
