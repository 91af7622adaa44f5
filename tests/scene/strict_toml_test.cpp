#include "host/support/strict_toml.h"

#include <catch2/catch.hpp>

#include "host/support/error.h"

using Catch::Matchers::Contains;
using torquer::NearestName;
using torquer::StrictTable;
using torquer::UserError;

TEST_CASE("A strict table names file, line, key, value and range", "[scene]") {
  StrictTable table = StrictTable::Parse("a = 1\n\n[wire]\nradius_mm = -2\nname = 3\n", "s.toml");
  StrictTable& wire = table.Table("wire");
  CHECK_THROWS_WITH(wire.Number("radius_mm", 0.1, 5),
                    "s.toml:4: wire.radius_mm = -2: is out of range; give a number from 0.1 to 5");
  CHECK_THROWS_WITH(wire.Text("name"), Contains("s.toml:5: wire.name = 3: is not a text"));
  CHECK_THROWS_WITH(wire.Number("length_mm", 0, 1), Contains("wire.length_mm: is missing"));
}

TEST_CASE("A strict table refuses NaN and infinity", "[scene]") {
  StrictTable table = StrictTable::Parse(
      "a = nan\nb = inf\nc = [1, nan]\nd = [[0, 0, inf], [0, 0, 0]]\n", "s.toml");
  CHECK_THROWS_AS(table.Number("a", -1, 1), UserError);
  CHECK_THROWS_AS(table.Number("b", -1, 1e300), UserError);
  CHECK_THROWS_AS(table.Numbers("c", -1, 1e300), UserError);
  CHECK_THROWS_AS(table.Points("d", 2), UserError);
}

TEST_CASE("A key that nobody read is an error, with the name that was meant", "[scene]") {
  StrictTable table = StrictTable::Parse("segment_mm = 1\nsegmnt_mm = 2\n", "s.toml");
  table.Number("segment_mm", 0, 2);
  CHECK_THROWS_WITH(table.RefuseUnread(),
                    Contains("s.toml:2: segmnt_mm = 2") && Contains("did you mean segment_mm?"));
  StrictTable nested = StrictTable::Parse("[a]\nb = 1\n[[c]]\nd = 1\n[[c]]\ne = 2\n", "s.toml");
  nested.Table("a").Number("b", 0, 1);
  for (StrictTable* one : nested.Tables("c")) one->Number("d", 0, 1, 0);
  CHECK_THROWS_WITH(nested.RefuseUnread(), Contains("s.toml:6: c[1].e = 2"));
}

TEST_CASE("A file that is not TOML names the line", "[scene]") {
  CHECK_THROWS_WITH(StrictTable::Parse("a = 1\nb = = 2\n", "s.toml"), Contains("s.toml:2"));
  CHECK_THROWS_WITH(StrictTable::Read("no/such/file.toml"), Contains("no/such/file.toml"));
}

TEST_CASE("The nearest name is near, or none", "[scene]") {
  const std::vector<std::string> known = {"friction", "torsion", "gravity"};
  CHECK(NearestName("frction", known) == "friction");
  CHECK(NearestName("torsoin", known) == "torsion");
  CHECK(NearestName("heartbeat", known).empty());
}
