#include "calibration/calibration_file.h"

#include <sys/stat.h>

#include <catch2/catch.hpp>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <optional>

#include "host/support/error.h"
#include "host/support/fnv1a.h"
#include "tests/support/file_contents.h"
#include "tests/support/paths.h"
#include "tests/support/temporary_folder.h"

namespace {

using namespace torquer::calibration;
using torquer::UserError;
using torquer::test::Contents;
using torquer::test::TemporaryFolder;

Calibration Measured() {
  Calibration calibration;
  calibration.device = "BENCH-42";
  calibration.note = "a \"quoted\" back\\slash";
  calibration.motion.cpi = 1600;
  calibration.motion.per_count = {{{0.0158751234567891, -1.0 / 3e5}, {1.23e-5, 0.00311}}};
  calibration.motion.standard_error = {{{1e-6, 2e-6}, {3e-7, 4.5e-7}}};
  calibration.lao = {.center = 518.25,
                     .minimum = 3.0,
                     .maximum = 1019.0,
                     .dead_zone = 11.0,
                     .full_rate_rad_per_s = 0.4};
  calibration.cra = {.center = 498.0,
                     .minimum = 7.0,
                     .maximum = 1001.0,
                     .dead_zone = 9.5,
                     .full_rate_rad_per_s = 0.3};
  return calibration;
}

bool Same(const JoystickAxis& a, const JoystickAxis& b) {
  return a.center == b.center && a.minimum == b.minimum && a.maximum == b.maximum &&
         a.dead_zone == b.dead_zone && a.full_rate_rad_per_s == b.full_rate_rad_per_s;
}

bool Same(const Calibration& a, const Calibration& b) {
  return a.device == b.device && a.note == b.note && a.motion.cpi == b.motion.cpi &&
         a.motion.per_count == b.motion.per_count &&
         a.motion.standard_error == b.motion.standard_error && Same(a.lao, b.lao) &&
         Same(a.cra, b.cra);
}

// Error message for a text; "" if it is accepted.
std::string RefusalOf(const std::string& text) {
  try {
    ParseCalibration(text, "bench.toml");
  } catch (const UserError& error) {
    return error.what();
  }
  return "";
}

std::string Replaced(std::string text, const std::string& from, const std::string& to) {
  const std::size_t at = text.find(from);
  REQUIRE(at != std::string::npos);
  return text.replace(at, from.size(), to);
}

// Recomputes the checksum, so that only the content can be refused.
std::string Resealed(const std::string& text) {
  const std::string marker = "[end]\nchecksum = \"";
  const std::size_t end = text.rfind(marker);
  return text.substr(0, end) + marker + torquer::Hex(torquer::Fnv1a(text.substr(0, end))) + "\"\n";
}

}  // namespace

TEST_CASE("A written calibration is read back bit for bit") {
  const TemporaryFolder folder;
  const std::string path = folder.Path("bench.toml");
  WriteCalibration(Measured(), path);
  CHECK(Same(ReadCalibration(path), Measured()));
  CHECK(Contents(path) == FormatCalibration(Measured()));
  // No temporary file is left behind.
  CHECK(std::distance(std::filesystem::directory_iterator(folder.Path()), {}) == 1);
}

TEST_CASE("Every truncation is refused") {
  const std::string text = FormatCalibration(Measured());
  for (std::size_t length = 0; length < text.size(); ++length) {
    const std::string refusal = RefusalOf(text.substr(0, length));
    CAPTURE(length, refusal);
    REQUIRE(refusal.find("bench.toml:") == 0);
    REQUIRE(refusal.find("torquer-calibrate") != std::string::npos);
  }
  CHECK(RefusalOf(text.substr(0, text.size() - 1)).find("incomplete") != std::string::npos);
}

TEST_CASE("Every altered byte is refused") {
  const std::string text = FormatCalibration(Measured());
  for (std::size_t i = 0; i < text.size(); ++i) {
    std::string altered = text;
    altered[i] = altered[i] == '7' ? '8' : '7';
    CAPTURE(i);
    REQUIRE_FALSE(RefusalOf(altered).empty());
  }
  CHECK_FALSE(RefusalOf(text + "x = 1\n").empty());
}

TEST_CASE("Refusals name the file, the line or field, the value and the remedy") {
  const std::string text = FormatCalibration(Measured());
  const auto [from, to, expected] = GENERATE(table<std::string, std::string, std::string>({
      {"version = 1", "version = 2", ":4: version = 2: this program reads version 1 only"},
      {"torquer-calibration", "shopping-list", "not a Torquer calibration"},
      {"device = \"BENCH-42\"", "device = 42", ":5: device = 42: is not a text"},
      {"device = \"BENCH-42\"\n", "", "device: is missing"},
      {"cpi = 1600", "cpi = 16.5",
       ":10: motion.cpi = 16.5: is not an integer; give an integer from 1 to 60000"},
      {"cpi = 1600", "cpi = 0",
       ":10: motion.cpi = 0: is out of range; give an integer from 1 to 60000"},
      {"cpi = 1600", "cpi = 1600\nspoons = 3", ":11: motion.spoons = 3: is not a known key"},
      {"note = ", "mood = \"good\"\nnote = ",
       "mood = 'good': is not a known key; remove it. Keys here: device, end, format"},
      {"[0.0158751234567891, ", "[nan, ",
       "motion.insertion_mm_per_count = [ nan, -3.3333333333333333e-06 ]: holds nan; give"},
      {"[0.0158751234567891, ", "[15.0, ", "holds 15.0; give a list of numbers from -1 to 1"},
      {"[0.0158751234567891, ", "[\"far\", ", "holds 'far'; give a list of numbers"},
      {"[0.0158751234567891, ", "[1.0, 0.5, ", "is not a pair of numbers"},
      {"[1.23e-05, 0.00311]", "[0.0158751234567891, -3.3333333333333333e-06]",
       "parallel to motion.insertion_mm_per_count"},
      {"center = 518.25", "center = -1.0",
       "joystick.lao.center = -1.0: is out of range; give a number from 0 to 1023"},
      {"dead_zone = 9.5", "dead_zone = 500.0",
       "joystick.cra.dead_zone = 500.0: the extremes are not outside the dead zone"},
      {"full_rate_rad_per_s = 0.4", "full_rate_rad_per_s = inf", "full_rate_rad_per_s = inf"},
      {"[joystick.lao]", "[joystick.throttle]", "joystick.lao: is missing"},
  }));
  const std::string refusal = RefusalOf(Resealed(Replaced(text, from, to)));
  CAPTURE(from, to, refusal);
  CHECK(refusal.find("bench.toml:") == 0);
  CHECK(refusal.find(expected) != std::string::npos);
  CHECK(refusal.find("torquer-calibrate") != std::string::npos);
}

TEST_CASE("Anything else is refused") {
  for (const char* text : {"", "\n", "hello", "\xff\xfe\x00", "[end]\nchecksum = \"0\"\n",
                           "format = \"torquer-calibration\"\n", "format = 3\n"}) {
    CAPTURE(text);
    CHECK_FALSE(RefusalOf(text).empty());
  }
}

TEST_CASE("Another device's calibration is refused") {
  CHECK_NOTHROW(RequireDevice(Measured(), "bench.toml", "BENCH-42"));
  CHECK_THROWS_WITH(RequireDevice(Measured(), "bench.toml", "BENCH-43"),
                    Catch::Contains("bench.toml: device = 'BENCH-42', but the device here is "
                                    "'BENCH-43'") &&
                        Catch::Contains("torquer-calibrate"));
}

TEST_CASE("A calibration keeps its sensor, and is refused for another one") {
  Calibration calibration = Measured();
  CHECK_FALSE(ParseCalibration(FormatCalibration(calibration), "a.toml").sensor_product_id);
  CHECK_NOTHROW(RequireSensor(calibration, "bench.toml", 0x47));  // unknown
  calibration.sensor_product_id = 0x42;
  const std::string text = FormatCalibration(calibration);
  CHECK_THAT(text, Catch::Contains("sensor = 0x42\n"));
  CHECK(ParseCalibration(text, "a.toml").sensor_product_id == 0x42);
  CHECK_NOTHROW(RequireSensor(calibration, "bench.toml", 0x42));
  CHECK_NOTHROW(RequireSensor(calibration, "bench.toml", std::nullopt));
  CHECK_THROWS_WITH(RequireSensor(calibration, "bench.toml", 0x47),
                    Catch::Contains("bench.toml: sensor = 0x42") && Catch::Contains("0x47 now") &&
                        Catch::Contains("torquer-calibrate"));
  calibration.sensor_product_id = 256;
  CHECK_THROWS_WITH(WriteCalibration(calibration, "unwritten.toml"), Catch::Contains("sensor"));
}

TEST_CASE("A calibration that is out of range is not written, and the old file stays") {
  const TemporaryFolder folder;
  const std::string path = folder.Path("bench.toml");
  WriteCalibration(Measured(), path);
  const std::string before = Contents(path);
  Calibration bad = Measured();
  bad.motion.per_count[0][0] = std::nan("");
  CHECK_THROWS_AS(WriteCalibration(bad, path), UserError);
  CHECK(Contents(path) == before);
}

TEST_CASE("A missing file is reported with the remedy") {
  CHECK_THROWS_WITH(
      ReadCalibration("/no/such/file.toml"),
      Catch::Contains("/no/such/file.toml: cannot be read") && Catch::Contains("--uncalibrated"));
}

TEST_CASE("The emulated device's calibration is the nominal one") {
  const std::string path = torquer::test::SourcePath("/calibration/emulator.toml");
  Calibration expected = NominalCalibration("EMULATED-0001", kNominalCpi);
  expected.note = "the emulated bench device, exactly as drawn";
  CHECK(Same(ReadCalibration(path), expected));
  // Byte for byte: the written format has not changed since version 1.
  CHECK(FormatCalibration(expected) == Contents(path));
}

TEST_CASE("A device's file is found by its serial number, in the user's configuration") {
  struct Variable {  // restores the environment
    explicit Variable(const char* its_name) : name(its_name) {
      if (const char* value = std::getenv(name)) before = value;
    }
    ~Variable() { before ? setenv(name, before->c_str(), 1) : unsetenv(name); }
    const char* name;
    std::optional<std::string> before;
  };
  const Variable home("HOME");
  const Variable config("XDG_CONFIG_HOME");
  setenv("HOME", "/home/user", 1);
  setenv("XDG_CONFIG_HOME", "/config", 1);
  CHECK(CalibrationPath("BENCH-42") == "/config/torquer/BENCH-42.toml");
  CHECK(CalibrationPath("046d:c077") == "/config/torquer/046d_c077.toml");
  // A serial number from a device cannot lead out of the folder.
  CHECK(CalibrationPath("../../etc/x") == "/config/torquer/_._.._etc_x.toml");
  CHECK(CalibrationPath("..") == "/config/torquer/_..toml");
  CHECK(CalibrationPath("") == "/config/torquer/_.toml");
  setenv("XDG_CONFIG_HOME", "not/absolute", 1);
  CHECK(CalibrationPath("BENCH-42") == "/home/user/.config/torquer/BENCH-42.toml");
  unsetenv("XDG_CONFIG_HOME");
  unsetenv("HOME");
  CHECK_THROWS_WITH(CalibrationPath("BENCH-42"), Catch::Contains("XDG_CONFIG_HOME nor HOME"));
}
