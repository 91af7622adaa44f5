#include "host/support/nearest_name.h"

#include <catch2/catch.hpp>
#include <ctime>

using torquer::NearestName;

TEST_CASE("The nearest name is near, or none", "[support]") {
  const std::vector<std::string> known = {"friction", "torsion", "gravity"};
  CHECK(NearestName("frction", known) == "friction");
  CHECK(NearestName("torsoin", known) == "torsion");
  CHECK(NearestName("Gravity", known) == "gravity");
  CHECK(NearestName("heartbeat", known).empty());
  CHECK(NearestName("", known).empty());
  CHECK(NearestName("friction", {}).empty());
}

TEST_CASE("A name that was cut short is found by its beginning", "[support]") {
  const std::vector<std::string> known = {"voxel_mm", "radius_mm", "entry_point_mm"};
  CHECK(NearestName("voxel", known) == "voxel_mm");
  CHECK(NearestName("vox", known) == "voxel_mm");
  CHECK(NearestName("entry", known) == "entry_point_mm");
  CHECK(NearestName("entry-point", known) == "entry_point_mm");
  // A name with an extra word, such as another unit.
  CHECK(NearestName("radius_mm_inner", known) == "radius_mm");
  // Too many names begin with these two letters.
  CHECK(NearestName("vo", known).empty());
}

TEST_CASE("The nearest of several names is taken", "[support]") {
  // A missing unit is likelier than a wrong letter; of two longer names the shorter is likelier.
  CHECK(NearestName("length", {"lengths_count", "length_mm", "lenght"}) == "length_mm");
  // Extra words are less likely than an extra letter.
  CHECK(NearestName("side_of_mmx", {"side", "side_of_mm"}) == "side_of_mm");
  CHECK(NearestName("pushes", {"push", "pushes_wanted_at_most", "pushes_wanted"}) ==
        "pushes_wanted");
  CHECK(NearestName("--dura", {"--duration", "--drop", "--help"}) == "--duration");
  CHECK(NearestName("--durration", {"--duration", "--drop", "--help"}) == "--duration");
  CHECK(NearestName("--x", {"--duration", "--drop", "--help"}).empty());
  CHECK(NearestName("lao", {"cra", "xray"}).empty());
}

TEST_CASE("A name as long as a file is compared with no short one", "[support]") {
  const std::vector<std::string> known(100, "voxel_mm");
  const std::clock_t before = std::clock();
  CHECK(NearestName(std::string(1'000'000, 'v'), known).empty());
  CHECK(NearestName("voxel_mm" + std::string(1'000'000, 'm'), known) == "voxel_mm");
  CHECK(std::clock() - before < 2 * CLOCKS_PER_SEC);
}
