// Firmware images and pictures of the sensor, requested from the firmware in the emulator as a
// program would request them.
#include <filesystem>
#include <fstream>

#include "calibration/focus.h"
#include "host/device/sensor_firmware.h"
#include "host/device/sensor_picture.h"
#include "host/support/error.h"
#include "tests/support/emulated_bench.h"
#include "tests/support/temporary_folder.h"

namespace torquer::device {
namespace {

using Catch::Contains;
using emulator::Bench;
using emulator::TestSrom;
using emulator::TransferStatus;

class EmulatedReports final : public FeatureReports {
 public:
  explicit EmulatedReports(Bench& bench) : bench_(bench) {}
  std::vector<std::uint8_t> Get(std::uint8_t id, std::size_t size) override {
    const auto result = bench_.host.Control(
        {0xa1, 1, static_cast<std::uint16_t>(0x300 | id), 0, static_cast<std::uint16_t>(size)});
    if (result.status != TransferStatus::kDone) throw ReportRefused("stall");
    return result.data;
  }
  void Set(std::span<const std::uint8_t> report) override {
    if (bench_.host.SetFeature({report.begin(), report.end()}).status != TransferStatus::kDone) {
      throw ReportRefused("stall");
    }
  }

 private:
  Bench& bench_;
};

std::string File(const test::TemporaryFolder& folder, const std::vector<std::uint8_t>& bytes) {
  const std::string path = folder.Path("image.bin");
  std::ofstream(path, std::ios::binary)
      .write(reinterpret_cast<const char*>(bytes.data()),
             static_cast<std::streamsize>(bytes.size()));
  return path;
}

TEST_CASE("an image is loaded from a file into the sensor") {
  const test::TemporaryFolder folder;
  Bench bench;
  bench.Start();
  EmulatedReports reports(bench);
  CHECK(RunningSrom(reports) == 0);
  CHECK(LoadSrom(reports, ReadSromFile(File(folder, TestSrom()))) == 5);
  CHECK(bench.device.sensor().srom() == TestSrom());
  CHECK(RunningSrom(reports) == 5);
  bench.CheckRules();
}

TEST_CASE("a file without an image is refused with its name, its contents and the remedy") {
  const test::TemporaryFolder folder;
  const auto refusal = [&](const std::vector<std::uint8_t>& bytes) {
    try {
      ReadSromFile(File(folder, bytes));
    } catch (const UserError& error) {
      return std::string(error.what());
    }
    return std::string("taken");
  };
  std::vector<std::uint8_t> bytes = TestSrom();
  CHECK(refusal(bytes) == "taken");
  bytes.pop_back();
  CHECK_THAT(refusal(bytes),
             Contains("image.bin") && Contains("has 4093 bytes") && Contains("4094"));
  bytes.resize(100000, 0x80);
  CHECK_THAT(refusal(bytes), Contains("more than 4094 bytes"));
  CHECK_THAT(refusal({}), Contains("has 0 bytes"));
  const std::string text = "0x01, 0x04, 0x8e,\n";
  CHECK_THAT(refusal({text.begin(), text.end()}), Contains("is a text file"));
  CHECK_THROWS_WITH(ReadSromFile("/nonexistent/srom"), Contains("/nonexistent/srom"));
  CHECK_THROWS_AS(ReadSromFile(folder.Path("")), UserError);
}

TEST_CASE(
    "an image that the sensor does not take, and a sensor that is not there, are distinguished") {
  Bench bench;
  bench.Start();
  EmulatedReports reports(bench);
  bench.device.sensor().ExpectSrom(TestSrom());
  std::vector<std::uint8_t> spoiled = TestSrom();
  spoiled[3000] ^= 0x10;
  CHECK_THROWS_WITH(LoadSrom(reports, spoiled), Contains("damaged"));
  bench.Run(1);
  CHECK(LoadSrom(reports, TestSrom()) == 5);
  bench.device.sensor().SetFault(emulator::VirtualPmw3360::Fault::kSilent);
  bench.Run(0.2);
  CHECK_THROWS_WITH(LoadSrom(reports, TestSrom()), Contains("does not answer"));
  CHECK_THROWS_WITH(TakeSensorPicture(reports), Contains("does not answer"));
}

calibration::FocusVerdict Judge(const emulator::SurfaceOptics& optics) {
  Bench bench;
  bench.device.SetHand([](double time_s) {
    emulator::HandState hand;
    hand.insertion_mm = 2 * time_s;
    return hand;
  });
  bench.device.sensor().SetOptics(optics);
  bench.Start();
  EmulatedReports reports(bench);
  std::vector<calibration::FocusPicture> pictures;
  int surface_quality = 0;
  for (int i = 0; i < 4; ++i) {
    SensorPicture picture = TakeSensorPicture(reports);
    pictures.push_back(std::move(picture.pixels));
    surface_quality = picture.surface_quality;
    CHECK(picture.shutter == 0x60);
    bench.Run(0.3);
  }
  bench.CheckRules();
  return calibration::JudgeFocus(pictures, surface_quality);
}

TEST_CASE("through the firmware, an assembly that is right is distinguished from one that is not") {
  using emulator::SurfaceOptics;
  std::vector<calibration::FocusHeight> heights;
  for (const double distance_mm : {2.2, 2.4, 2.6}) {
    const calibration::FocusVerdict seen = Judge({.distance_mm = distance_mm});
    CHECK(seen.good);
    heights.push_back({distance_mm - 2.0, seen.figures.sharpness});
  }
  CHECK(calibration::FindFocus(heights).best_shims_mm == Approx(0.4).margin(0.05));
  CHECK(Judge({.dirt = 0.05, .side_shading = 1.1}).good);
  const calibration::FocusVerdict shaded = Judge({.side_shading = 1.7});
  CHECK(shaded.figures.shading_across == Approx(1.7).margin(0.1));
  CHECK_THAT(shaded.findings.front(), Contains("across the pipe"));
  const calibration::FocusVerdict dirty = Judge({.dirt = 0.25});
  CHECK_THAT(dirty.findings.front(), Contains("clean"));
}

}  // namespace
}  // namespace torquer::device
