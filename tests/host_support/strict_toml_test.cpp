#include "host/support/strict_toml.h"

#include <catch2/catch.hpp>

#include "host/support/error.h"

using Catch::Contains;
using torquer::StrictTable;
using torquer::UserError;

TEST_CASE("A strict table names file, line, key, value and range", "[support]") {
  StrictTable table = StrictTable::Parse("a = 1\n\n[wire]\nradius_mm = -2\nname = 3\n", "s.toml");
  StrictTable& wire = table.Table("wire");
  CHECK_THROWS_WITH(wire.Number("radius_mm", 0.1, 5),
                    "s.toml:4: wire.radius_mm = -2: is out of range; give a number from 0.1 to 5");
  CHECK_THROWS_WITH(wire.Text("name"), Contains("s.toml:5: wire.name = 3: is not a text"));
  CHECK_THROWS_WITH(wire.Number("length_mm", 0, 1), Contains("wire.length_mm: is missing"));
}

TEST_CASE("A strict table refuses NaN and infinity", "[support]") {
  StrictTable table = StrictTable::Parse(
      "a = nan\nb = inf\nc = [1, nan]\nd = [[0, 0, inf], [0, 0, 0]]\n", "s.toml");
  CHECK_THROWS_AS(table.Number("a", -1, 1), UserError);
  CHECK_THROWS_AS(table.Number("b", -1, 1e300), UserError);
  CHECK_THROWS_AS(table.Numbers("c", -1, 1e300), UserError);
  CHECK_THROWS_AS(table.Points("d", 2), UserError);
}

TEST_CASE("An unread key is an error, with the nearest name", "[support]") {
  StrictTable table = StrictTable::Parse("segment_mm = 1\nsegmnt_mm = 2\n", "s.toml");
  table.Number("segment_mm", 0, 2);
  CHECK_THROWS_WITH(table.RefuseUnread(),
                    Contains("s.toml:2: segmnt_mm = 2") && Contains("did you mean segment_mm?"));
  StrictTable nested = StrictTable::Parse("[a]\nb = 1\n[[c]]\nd = 1\n[[c]]\ne = 2\n", "s.toml");
  nested.Table("a").Number("b", 0, 1);
  for (StrictTable* one : nested.Tables("c")) one->Number("d", 0, 1, 0);
  CHECK_THROWS_WITH(nested.RefuseUnread(), Contains("s.toml:6: c[1].e = 2"));
}

TEST_CASE("A file that is not TOML names the line", "[support]") {
  CHECK_THROWS_WITH(StrictTable::Parse("a = 1\nb = = 2\n", "s.toml"), Contains("s.toml:2"));
  CHECK_THROWS_WITH(StrictTable::Read("no/such/file.toml"), Contains("no/such/file.toml"));
}

TEST_CASE("An unknown key is refused with the keys that exist there", "[support]") {
  const auto read = [](const std::string& text) {
    StrictTable table = StrictTable::Parse(text, "s.toml");
    table.Number("segment_mm", 0, 2, 1);
    StrictTable& vessel = table.Table("vessel");
    vessel.Number("voxel_mm", 0, 1, 0.5);
    vessel.Text("file", "none");
    vessel.Boolean("closed", false);
    table.RefuseUnread();
  };
  CHECK_NOTHROW(read("[vessel]\nvoxel_mm = 0.25\n"));
  // The key lacks its unit.
  CHECK_THROWS_WITH(read("[vessel]\nvoxel = 0.25\n"),
                    "s.toml:2: vessel.voxel = 0.25: is not a known key; did you mean voxel_mm? "
                    "Keys here: closed, file, voxel_mm");
  CHECK_THROWS_WITH(read("[vessel]\ncolor = \"red\"\n"),
                    "s.toml:2: vessel.color = 'red': is not a known key; remove it. "
                    "Keys here: closed, file, voxel_mm");
  CHECK_THROWS_WITH(read("vessle = 1\n[vessel]\n"),
                    "s.toml:1: vessle = 1: is not a known key; did you mean vessel? "
                    "Keys here: segment_mm, vessel");
  StrictTable unread = StrictTable::Parse("a = 1\n", "s.toml");
  CHECK_THROWS_WITH(unread.RefuseUnread(),
                    "s.toml:1: a = 1: is not a known key; remove it. This table has no keys.");
}

TEST_CASE("A strict table refuses a missing key without default", "[support]") {
  StrictTable table = StrictTable::Parse("count = 3\nnote = \"\"\nratio = 2.5\n", "s.toml");
  CHECK(table.Integer("count", 1, 3) == 3);
  CHECK(table.Integer("missing", 1, 3, 2) == 2);
  CHECK_THROWS_WITH(table.Integer("missing", 1, 3),
                    Contains("missing: is missing; give an integer from 1 to 3"));
  CHECK_THROWS_WITH(table.Integer("count", 1, 2), Contains("s.toml:1: count = 3: is out of range"));
  CHECK_THROWS_WITH(table.Integer("ratio", 1, 3), Contains("s.toml:3: ratio = 2.5: is not an int"));
  CHECK(table.AnyText("note").empty());
  CHECK_THROWS_WITH(table.AnyText("missing"), Contains("missing: is missing; give a text"));
  CHECK_THROWS_WITH(table.Text("note"), Contains("note = '': is empty"));
}

TEST_CASE("A refused number is in the message as people write it", "[support]") {
  StrictTable table = StrictTable::Parse(
      "a = 0.3\nb = [0.1, 1e-3, [2.5]]\nc = []\nd = 6.35e-3\ne = -500.0\n", "s.toml");
  CHECK_THROWS_WITH(table.Number("a", 1, 2), Contains("s.toml:1: a = 0.3: is out"));
  CHECK_THROWS_WITH(table.Numbers("b", 0, 1), Contains("b = [ 0.1, 0.001, [ 2.5 ] ]: holds"));
  CHECK_THROWS_WITH(table.Numbers("c", 0, 1), Contains("c = []: is not a list"));
  CHECK_THROWS_WITH(table.Number("d", 1, 2), Contains("d = 0.00635: is out"));
  CHECK_THROWS_WITH(table.Number("e", 1, 2), Contains("e = -500.0: is out"));
}

TEST_CASE("A long value is cut in the message", "[support]") {
  StrictTable table = StrictTable::Parse("name = \"" + std::string(1000, 'x') + "\"\n", "s.toml");
  CHECK_THROWS_WITH(table.Number("name", 0, 1), Contains("xxx...: is not a number"));
  StrictTable list =
      StrictTable::Parse("list = [\n  1.5,\n  \"" + std::string(30, 'y') + "\"\n]\n", "s.toml");
  CHECK_THROWS_WITH(list.Number("list", 0, 1),
                    Contains("list = [ 1.5, 'yyy") && Contains("yyy' ]: is"));
}

TEST_CASE("Text that is nested too deeply is refused before it is parsed", "[support]") {
  const auto many = [](const std::string& piece, int times) {
    std::string text;
    for (int k = 0; k < times; ++k) text += piece;
    return text;
  };
  struct Deep {
    std::string before, open, middle, close, after;
  };
  // Maximum nesting of each syntax; the message must count the lines before it.
  const Deep deep = GENERATE(Deep{"", "a.", "a = 1", "", ""}, Deep{"", "'a'.", "a = 1", "", ""},
                             Deep{"", "\"a\" . ", "a = 1", "", ""}, Deep{"[", "a.", "a]", "", ""},
                             Deep{"[[", "a.", "a]]", "", ""}, Deep{"b = {", "a.", "a = 1}", "", ""},
                             Deep{"b = ", "[", "1", "]", ""}, Deep{"b = ", "[\n", "1", "]", ""},
                             Deep{"b = ", "{a=", "1", "}", ""}, Deep{"b = ", "[{a=", "1", "}]", ""},
                             Deep{"b = ", "{a.a.a=", "1", "}", ""}, Deep{"b = ", "[", "", "", ""});
  CAPTURE(deep.before, deep.open, deep.close);
  const auto text = [&](int times) {
    return "# [[[[ \"\n" + deep.before + many(deep.open, times) + deep.middle +
           many(deep.close, times) + deep.after + "\n";
  };
  for (const int times : {33, 40'000, 1'000'000}) {
    CHECK_THROWS_WITH(StrictTable::Parse(text(times), "s.toml"),
                      Contains("s.toml:") && Contains("; flatten it"));
  }
  const bool whole = !deep.middle.empty();
  if (whole) CHECK_NOTHROW(StrictTable::Parse(text(8), "s.toml"));
}

TEST_CASE("Brackets and dots of texts and comments do not count as depth", "[support]") {
  const std::string marks = std::string(500, '[') + std::string(500, '.');
  for (const std::string& text :
       {"a = \"\\\"" + marks + "\"\n", "a = '" + marks + "'\n", "# \"" + marks + "\n",
        "a = \"\"\"\n" + marks + "\"\n" + marks + "\"\"\"\n", "a = '''" + marks + "\\'''\n"}) {
    CAPTURE(text);
    CHECK_NOTHROW(StrictTable::Parse(text, "s.toml"));
  }
}

TEST_CASE("Text that is longer than any key or value is refused before it is parsed", "[support]") {
  const std::string fits(4096, 'a'), long_one(4097, 'a');
  CHECK_NOTHROW(StrictTable::Parse(fits + " = 1\n", "s.toml"));
  CHECK_NOTHROW(StrictTable::Parse("[" + fits + "]\n", "s.toml"));
  CHECK_NOTHROW(StrictTable::Parse("'" + long_one + "' = \"" + long_one + "\"\n", "s.toml"));
  CHECK_NOTHROW(StrictTable::Parse("# " + long_one + "\na" + std::string(5000, ' ') + "= 1\n", ""));
  for (const std::string& text :
       {long_one + " = 1", "a = " + long_one, "a = 1\nb = [1, " + long_one, "[" + long_one + "]",
        "'b'." + long_one + ".'c' = 1"}) {
    CAPTURE(text);
    CHECK_THROWS_WITH(StrictTable::Parse(text + "\n", "s.toml"),
                      Contains("a key or value has more than 4096 bytes; shorten it"));
  }
  CHECK_THROWS_WITH(StrictTable::Parse("a = 1\n\n" + long_one, "s.toml"), Contains("s.toml:3: "));
}

TEST_CASE("A list of more tables than are read is refused", "[support]") {
  std::string text;
  for (int k = 0; k < 1000; ++k) text += "[[tube]]\n";
  CHECK(StrictTable::Parse(text, "s.toml").Tables("tube").size() == 1000);
  CHECK_THROWS_WITH(
      StrictTable::Parse(text + "[[tube]]\n", "s.toml").Tables("tube"),
      Contains("s.toml:1: tube = ") && Contains(": has 1001 tables; give at most 1000"));
}
