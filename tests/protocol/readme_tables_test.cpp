// Byte tables of protocol/README.md, one per report. The test generates them from hid_reports.h and
// compares, so that they stay in sync. On failure it prints the table to paste between the markers.
#include <catch2/catch.hpp>
#include <fstream>
#include <sstream>
#include <string>

#include "protocol/bootloader_reports.h"
#include "protocol/hid_reports.h"
#include "tests/support/paths.h"

namespace torquer::protocol {
namespace {

class Table {
 public:
  Table() { text_ << "| byte | type | field | meaning |\n|---|---|---|---|\n"; }

  void Row(const char* type, int size, const char* name, int count, const char* meaning) {
    const int bytes = size * count;
    text_ << "| " << offset_;
    if (bytes > 1) text_ << '-' << offset_ + bytes - 1;
    text_ << " | " << type;
    if (count > 1) text_ << '[' << count << ']';
    text_ << " | " << name << " | " << meaning << " |\n";
    offset_ += bytes;
  }

  std::string text() const { return text_.str(); }

 private:
  std::ostringstream text_;
  int offset_ = 0;
};

#define ROW(type, name, meaning) table.Row(#type, sizeof(type), #name, 1, meaning);
#define FIELD_ARRAY(type, name, count, meaning) \
  table.Row(#type, sizeof(type), #name, count, meaning);
#define EXPECTED_TABLE(FIELDS) \
  [] {                         \
    Table table;               \
    FIELDS(ROW)                \
    return table.text();       \
  }()

/// The lines of README.md between `<!-- table NAME -->` and `<!-- end -->`.
std::string TableInReadme(const std::string& name) {
  std::ifstream readme(torquer::test::SourcePath("/protocol/README.md"));
  REQUIRE(readme);
  const std::string marker = std::string("<!-- table ").append(name).append(" -->");
  std::string line;
  while (std::getline(readme, line) && line != marker) {
  }
  std::string table;
  while (std::getline(readme, line) && line != "<!-- end -->") table.append(line).append("\n");
  return table;
}

void Compare(const std::string& name, const std::string& expected) {
  INFO("protocol/README.md, table " << name << ", must read:\n" << expected);
  CHECK(TableInReadme(name) == expected);
}

TEST_CASE("the byte tables in README.md are those of hid_reports.h") {
  Compare("InputReport", EXPECTED_TABLE(TORQUER_INPUT_REPORT));
  Compare("IdentityReport", EXPECTED_TABLE(TORQUER_IDENTITY_REPORT));
  Compare("ConfigurationReport", EXPECTED_TABLE(TORQUER_CONFIGURATION_REPORT));
  Compare("DiagnosticsReport", EXPECTED_TABLE(TORQUER_DIAGNOSTICS_REPORT));
  Compare("CommandReport", EXPECTED_TABLE(TORQUER_COMMAND_REPORT));
  Compare("SromReport", EXPECTED_TABLE(TORQUER_SROM_REPORT));
  Compare("PictureReport", EXPECTED_TABLE(TORQUER_PICTURE_REPORT));
}

TEST_CASE("the byte tables in README.md are those of the bootloader and the image") {
  Compare("BootloaderStatusReport", EXPECTED_TABLE(TORQUER_BOOTLOADER_STATUS_REPORT));
  Compare("PageReport", EXPECTED_TABLE(TORQUER_PAGE_REPORT));
  Compare("BootloaderCommandReport", EXPECTED_TABLE(TORQUER_BOOTLOADER_COMMAND_REPORT));
  Compare("ImageTrailer", EXPECTED_TABLE(TORQUER_IMAGE_TRAILER));
}

}  // namespace
}  // namespace torquer::protocol
