// Retry test: the daemon asks a device that does not answer to load its sensor's image again.
#include "host/daemon/sensor_image.h"

#include <catch2/catch.hpp>
#include <cstdlib>
#include <cstring>

#include "host/device/sensor_firmware.h"
#include "protocol/hid_reports.h"
#include "tests/support/temporary_folder.h"

namespace {

using torquer::daemon::SensorImage;
namespace device = torquer::device;
namespace protocol = torquer::protocol;

// Device whose sensor accepts any image, but whose answers may get lost.
struct ForgetfulDevice : device::ReportSource {
  void Wait(int, const Sink&) override {}
  void LetGo(const std::string&) override {}
  void Interrupt() override {}
  std::vector<std::uint8_t> GetFeature(std::uint8_t id) override {
    if (lost_gets-- > 0) throw device::FeatureTimeout("no answer in time");
    protocol::DiagnosticsReport report{};
    report.report_id = id;
    report.protocol_version = protocol::kProtocolVersion;
    report.srom_id = running ? 4 : 0;
    std::vector<std::uint8_t> bytes(sizeof report);
    std::memcpy(bytes.data(), &report, sizeof report);
    return bytes;
  }
  void SetFeature(std::span<const std::uint8_t>) override {
    ++sets;
    running = lost_sets-- <= 0 || taken_all_the_same;
    if (lost_sets >= 0) throw device::FeatureTimeout("no answer in time");
  }
  std::string place() const override { return "here"; }

  int lost_gets = 0, lost_sets = 0, sets = 0;
  bool running = false, taken_all_the_same = false;
};

struct Bench {
  Bench() {
    setenv("XDG_CONFIG_HOME", folder.Path().c_str(), 1);
    device::KeepSrom("X-1", std::vector<std::uint8_t>(protocol::kSromBytes, 0x80));
    image.OnConnected("X-1");
    image.OnReport(0);
  }
  // Loads until no image is due; returns the number of loads.
  int Loads() {
    int loads = 0;
    for (; image.due() && loads < 10; ++loads) image.Load(source);
    return loads;
  }

  torquer::test::TemporaryFolder folder;
  ForgetfulDevice source;
  SensorImage image;
};

}  // namespace

TEST_CASE("An image that the device has is not loaded, and one that it lacks is, once") {
  Bench bench;
  bench.source.running = GENERATE(true, false);
  const bool had = bench.source.running;
  CHECK(bench.Loads() == 1);
  CHECK(bench.source.sets == (had ? 0 : 1));
  CHECK(bench.image.loaded() == bench.source.sets);
}

TEST_CASE("Two answers may get lost") {
  Bench bench;
  SECTION("the state of the sensor") { bench.source.lost_gets = 2; }
  SECTION("a missing image") { bench.source.lost_sets = 2; }
  SECTION("an existing image") {
    bench.source.lost_sets = 1;
    bench.source.taken_all_the_same = true;
  }
  bench.Loads();
  CHECK(bench.source.running);
  CHECK(bench.image.loaded() == 1);
}

TEST_CASE("A device that never answers is left alone after three times, until the next loss") {
  Bench bench;
  bench.source.lost_sets = 1000;
  CHECK(bench.Loads() == 3);
  CHECK(bench.image.loaded() == 0);
  bench.source.lost_sets = 0;
  CHECK(bench.Loads() == 0);
  bench.image.OnReset();
  CHECK(bench.Loads() == 1);
  CHECK(bench.image.loaded() == 1);
}
