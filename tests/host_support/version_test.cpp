#include "firmware/src/version.h"

#include <catch2/catch.hpp>

#include "torquer_version.h"

TEST_CASE("The firmware has the version of the project", "[support]") {
  // Set both: project(VERSION) in CMakeLists.txt, and firmware/src/version.h, which is built
  // without CMake.
  CHECK(int{torquer::firmware::kVersionMajor} == torquer::kVersionMajor);
  CHECK(int{torquer::firmware::kVersionMinor} == torquer::kVersionMinor);
  CHECK(int{torquer::firmware::kVersionPatch} == torquer::kVersionPatch);
}
