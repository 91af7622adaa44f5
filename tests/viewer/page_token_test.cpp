#include "host/viewer/page_token.h"

#include <sys/stat.h>

#include <catch2/catch.hpp>
#include <fstream>

#include "host/support/error.h"
#include "tests/support/temporary_folder.h"

using namespace torquer;

TEST_CASE("A kept token is the same at the next start, and private") {
  const test::TemporaryFolder folder;
  const std::string path = folder.Path("token");
  const std::string token = viewer::KeptToken(path);
  CHECK(token.size() == 32);
  CHECK(token != viewer::RandomToken());
  CHECK(viewer::KeptToken(path) == token);
  struct stat status {};
  REQUIRE(stat(path.c_str(), &status) == 0);
  CHECK((status.st_mode & 0777) == 0600);
  REQUIRE(chmod(path.c_str(), 0644) == 0);
  CHECK_THROWS_AS(viewer::KeptToken(path), UserError);
}

TEST_CASE("A file that holds no token is refused") {
  const test::TemporaryFolder folder;
  const std::string path = folder.Path("token");
  const std::string content = GENERATE("", "short", "../../etc/passwd/../../../etc/pa",
                                       "0123456789abcdef0123456789abcdef0");
  std::ofstream(path) << content;
  REQUIRE(chmod(path.c_str(), 0600) == 0);
  CHECK_THROWS_AS(viewer::KeptToken(path), UserError);
}

TEST_CASE("A token file that cannot be created is refused") {
  const test::TemporaryFolder folder;
  CHECK_THROWS_AS(viewer::KeptToken(folder.Path("missing/token")), UserError);
  CHECK_THROWS_AS(viewer::KeptToken(folder.Path()), UserError);
}
