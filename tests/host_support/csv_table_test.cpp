#include "host/support/csv_table.h"

#include <catch2/catch.hpp>
#include <fstream>
#include <optional>
#include <string>
#include <vector>

#include "host/support/error.h"
#include "tests/support/temporary_folder.h"

using Catch::Contains;

namespace {

struct Csv {
  torquer::test::TemporaryFolder folder;
  std::string path = folder.Path() + "/t.csv";
  explicit Csv(const std::string& text) { std::ofstream(path) << text; }
};

}  // namespace

TEST_CASE("A CSV table gives its rows with their lines", "[support]") {
  const Csv csv("a,b\n# note\n1,2\n\n 3 ,x\r\n");
  const auto rows = torquer::ReadCsv(csv.path, "a,b");
  REQUIRE(rows.size() == 2);
  CHECK(rows[0].line == 3);
  CHECK(torquer::CsvNumber(csv.path, "a,b", rows[0], 1) == 2);
  CHECK(rows[1].line == 5);
  CHECK(torquer::CsvNumber(csv.path, "a,b", rows[1], 0) == 3);
  CHECK_THROWS_WITH(torquer::CsvNumber(csv.path, "a,b", rows[1], 1),
                    Contains("t.csv:5: b is 'x'; give a finite number"));
}

TEST_CASE("A CSV table is read as spreadsheets and R write it", "[support]") {
  const Csv marked("\xef\xbb\xbf\"a\",\"b\"\r\n1,\"2\"\r\n");
  const auto rows = torquer::ReadCsv(marked.path, "a,b");
  REQUIRE(rows.size() == 1);
  CHECK(torquer::CsvNumber(marked.path, "a,b", rows[0], 1) == 2);
  const Csv semicolons("a;b\n1,5;2\n");
  CHECK_THROWS_WITH(torquer::ReadCsvTable(semicolons.path),
                    Contains("t.csv:1: semicolons separate the columns"));
}

TEST_CASE("A CSV table skips what spreadsheets add, and names a form that is not CSV",
          "[support]") {
  const Csv extra("sep=,\r\na,b\r\n1,2\r\n,\r\n,\r\n");
  CHECK(torquer::ReadCsv(extra.path, "a,b").size() == 1);
  const auto refused = [](const std::string& text, const std::string& message) {
    const Csv csv(text);
    CHECK_THROWS_WITH(torquer::ReadCsvTable(csv.path), Contains(message));
  };
  refused("a\tb\n1\t2\n", "t.csv:1: tabs separate the columns");
  refused("a,b\r1,2\r", "t.csv:1: carriage returns alone end the lines; save");
  refused(std::string("\xff\xfe"
                      "a\0,\0b\0\n\0",
                      10),
          "t.csv:1: the text is UTF-16; save");
  // Without the mark, in either order of bytes.
  refused(std::string("a\0,\0b\0\r\0\n\0", 10), "t.csv:1: the text is UTF-16; save");
  refused(std::string("\0a\0,\0b\0\r\0\n", 10), "t.csv:1: the text is UTF-16; save");
  refused("\"\",\"a\"\n\"1\",2\n", "t.csv:1: column 1 has no name; name it or remove it (in R");
  refused("a,b,\n1,2,\n", "t.csv:1: column 3 has no name");
}

TEST_CASE("A CSV table reports an error with its place", "[support]") {
  CHECK_THROWS_WITH(torquer::ReadCsv("no/such.csv", "a"), Contains("no/such.csv"));
  CHECK_THROWS_WITH(torquer::ReadCsv(Csv("b,a\n").path, "a,b"), Contains("t.csv"));
  const Csv wrong("b,a\n1,2\n");
  CHECK_THROWS_WITH(torquer::ReadCsv(wrong.path, "a,b"),
                    Contains("t.csv:1: the header is 'b,a'; it must be 'a,b'"));
  const Csv ragged("a,b\n1,2\n1\n");
  CHECK_THROWS_WITH(torquer::ReadCsv(ragged.path, "a,b"),
                    Contains("t.csv:3: the row has 1 values"));
  const Csv empty("");
  CHECK_THROWS_WITH(torquer::ReadCsv(empty.path, "a,b"), Contains("empty"));
}

TEST_CASE("Long cells and headers of a CSV table are shortened in messages", "[support]") {
  const std::string text(200'000, 'x');
  for (const std::string& table :
       {"a\n" + text + "\n", text + "," + text + "\n1,2\n", text + "\n1,2\n", text + "\ny\n"}) {
    try {
      const torquer::CsvTable read = torquer::ParseCsvTable(table, "here");
      read.Number(read.rows.at(0), 0);
      FAIL("the table is not refused");
    } catch (const torquer::UserError& error) {
      const std::string message = error.what();
      INFO(message);
      CHECK_THAT(message, Contains("here:") && Contains("xxxxx.."));
      CHECK(message.size() < 500);
    }
  }
}

TEST_CASE("A CSV table of more columns than are read is refused", "[support]") {
  std::string header = "c0";
  for (int k = 1; k < 1000; ++k) header += ",c" + std::to_string(k);
  CHECK(torquer::ReadCsvTable(Csv(header + "\n").path).columns.size() == 1000);
  CHECK_THROWS_WITH(torquer::ReadCsvTable(Csv("# note\n" + header + ",c\n").path),
                    Contains("t.csv:2: the header has 1001 columns, but at most 1000 are allowed"));
}

TEST_CASE("Lines that arrive one by one are read with each row", "[support]") {
  std::vector<std::string> lines = {"# note", "a, b\r", "1,2", "", "3,4"};
  std::size_t taken = 0;
  const auto next = [&]() -> std::optional<std::string> {
    if (taken == lines.size()) return std::nullopt;
    return lines[taken++];
  };
  torquer::CsvReader reader("here", next);
  CHECK(taken == 0);
  REQUIRE(reader.ReadHeader());
  CHECK(taken == 2);
  CHECK(reader.table().columns == std::vector<std::string>{"a", "b"});
  CHECK(reader.Next()->line == 3);
  CHECK(taken == 3);
  const auto row = reader.Next();
  CHECK(row->line == 5);
  CHECK(reader.table().Number(*row, 1) == 4);
  CHECK_FALSE(reader.Next());
  lines.emplace_back("5");
  CHECK_THROWS_WITH(reader.Next(),
                    Contains("here:6: the row has 1 values, but the header 'a,b' names 2"));
  lines = {"# note"};
  taken = 0;
  CHECK_FALSE(torquer::CsvReader("here", next).ReadHeader());
  lines = {"a,a"};
  taken = 0;
  CHECK_THROWS_WITH(torquer::CsvReader("here", next).ReadHeader(),
                    Contains("here:1: the column a appears twice"));
}
