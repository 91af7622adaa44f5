// Program torquer-flash as a user runs it, on unmodified libusb. The bootloader and the firmware
// run in the emulator; umockdev mocks usbfs.
#include <catch2/catch.hpp>
#include <csignal>
#include <fstream>

#include "host/emulator/umockdev_front.h"
#include "tests/flash/emulated_boards.h"
#include "tests/support/child_process.h"
#include "tests/support/emulated_bench.h"
#include "tests/support/paths.h"
#include "tests/support/temporary_folder.h"

namespace {

using Catch::Contains;
using torquer::emulator::UmockdevBench;
using torquer::test::BenchDevice;
using torquer::test::BenchOptions;
using torquer::test::Bootloader;
using torquer::test::ChildProcess;
using torquer::test::FirmwareImage;
using torquer::test::kNewHex;
using torquer::test::kOldHex;
using torquer::test::kSlowHex;
using torquer::test::UsbHost;
using torquer::test::WithApplication;

struct Ended {
  int status;
  std::string output, error;
};

Ended Flash(std::vector<std::string> words) {
  words.insert(words.begin(), torquer::test::ProgramPath("torquer-flash"));
  ChildProcess program(words);
  const int status = program.Wait();
  return {status, program.Output(), program.Error()};
}

struct Bench {
  explicit Bench(const FirmwareImage& image)
      : device(image, Options(), [](double) { return torquer::emulator::HandState{}; }) {}
  static BenchOptions Options() {
    BenchOptions options;
    options.serial = "FLASH-1";
    return options;
  }
  void CutPowerAt(int operation) {
    device.Do([&](BenchDevice& bench, UsbHost&) {
      bench.CutPowerAtPageOperation(bench.page_operations() + operation);
    });
  }
  ~Bench() {
    device.Do([](BenchDevice& bench, UsbHost&) {
      for (const std::string& violation : bench.Violations()) FAIL_CHECK(violation);
    });
  }

  UmockdevBench device;
};

}  // namespace

TEST_CASE("the program flashes a new board, updates it, and refuses bad input") {
  Bench bench(Bootloader());
  const Ended first = Flash({});  // the image of this build
  CAPTURE(first.output, first.error);
  REQUIRE(first.status == 0);
  CHECK_THAT(first.output, Contains("found: FLASH-1") && Contains("without a valid application"));
  CHECK_THAT(first.output, Contains("firmware 0.1.0 runs on FLASH-1; self-test: application good, "
                                    "settings good, sensor good"));
  CHECK_THAT(first.output, !Contains("\r"));  // progress bars only on a terminal

  const Ended dry = Flash({kNewHex, "--dry-run"});
  CHECK(dry.status == 0);
  CHECK_THAT(dry.output, Contains("running firmware 0.1.0") && Contains("nothing was done"));

  const Ended update = Flash({kNewHex, "--device", "FLASH-1"});
  CAPTURE(update.output, update.error);
  CHECK(update.status == 0);
  CHECK_THAT(update.output, Contains("firmware 0.15.2 runs on FLASH-1"));

  const Ended older = Flash({kOldHex});
  CHECK(older.status == 2);
  CHECK_THAT(older.error, Contains("torquer-flash: firmware 0.15.2 is installed"));
  const Ended other_clock = Flash({kSlowHex, "--force"});
  CHECK(other_clock.status == 2);
  CHECK_THAT(other_clock.error, Contains("16 MHz"));
  const Ended no_image = Flash({torquer::test::SourcePath("/README.md")});
  CHECK(no_image.status == 2);
  CHECK_THAT(no_image.error, Contains("README.md:1: is not a line of an Intel HEX file"));
}

TEST_CASE("the cable is pulled while the program writes, and the next run finishes") {
  Bench bench(WithApplication());
  bench.CutPowerAt(60);
  const Ended cut = Flash({kNewHex});
  CAPTURE(cut.output, cut.error);
  CHECK(cut.status == 1);
  CHECK_THAT(cut.error, Contains("the board was lost while page 30 of ") &&
                            Contains("no valid application") && Contains("Run the same command"));
  bench.device.Plug();
  const Ended finished = Flash({kNewHex});
  CAPTURE(finished.output, finished.error);
  CHECK(finished.status == 0);
  CHECK_THAT(finished.output, Contains("an update was interrupted") && Contains("0.15.2 runs"));
}

TEST_CASE("the program is killed while it writes, and the next run finishes") {
  Bench bench(WithApplication());
  {
    ChildProcess killed({torquer::test::ProgramPath("torquer-flash"), kNewHex});
    bool written = false;
    for (int i = 0; i < 100000 && !written; ++i) {
      bench.device.Do(
          [&](BenchDevice& device, UsbHost&) { written = device.page_operations() > 9; });
      std::this_thread::sleep_for(std::chrono::milliseconds(1));
    }
    REQUIRE(written);
    killed.Signal(SIGKILL);
    CHECK(killed.Wait() == 128 + SIGKILL);
  }
  const Ended finished = Flash({kNewHex});
  CAPTURE(finished.output, finished.error);
  CHECK(finished.status == 0);
  CHECK_THAT(finished.output, Contains("an update was interrupted") && Contains("0.15.2 runs"));
}

TEST_CASE("a missing board is reported") {
  Bench bench(WithApplication());
  bench.device.Unplug();
  const Ended nobody = Flash({});
  CHECK(nobody.status == 2);
  CHECK_THAT(nobody.error, Contains("no board found"));
}

TEST_CASE("the program loads the sensor's image, and refuses what makes no sense") {
  const torquer::test::TemporaryFolder folder;
  const std::string path = folder.Path("srom.bin");
  const std::vector<std::uint8_t> image = torquer::emulator::TestSrom();
  std::ofstream(path, std::ios::binary)
      .write(reinterpret_cast<const char*>(image.data()),
             static_cast<std::streamsize>(image.size()));
  CHECK(Flash({"--srom", path, "--force"}).status == 2);
  CHECK(Flash({"--fuses", "usbasp", "--srom", path}).status == 2);

  Bench bench(WithApplication());
  setenv("XDG_CONFIG_HOME", folder.Path().c_str(), 1);  // where the image is kept
  const Ended loaded = Flash({"--srom", path});
  unsetenv("XDG_CONFIG_HOME");
  CAPTURE(loaded.output, loaded.error);
  CHECK(loaded.status == 0);
  CHECK_THAT(loaded.output, Contains("the sensor runs image 5"));
  bench.device.Do([&](BenchDevice& device, UsbHost&) { CHECK(device.sensor().srom() == image); });
  const std::string empty = folder.Path("empty.bin");
  std::ofstream(empty).flush();
  const Ended other = Flash({"--srom", empty});
  CHECK(other.status == 2);
  CHECK_THAT(other.error, Contains("empty.bin: has 0 bytes"));
  const Ended device = Flash({"--srom", "/dev/null"});
  CHECK(device.status == 2);
  CHECK_THAT(device.error, Contains("/dev/null: cannot be read: it is a device"));
}
