// Firmware with a sensor that behaves as in its data sheet. The sensor may enter rest mode, reset
// itself, freeze, take a firmware image, and send pictures.
#include <algorithm>
#include <cmath>
#include <numeric>
#include <random>

#include "tests/support/emulated_bench.h"

namespace torquer::emulator {
namespace {

bool Faulty(const Bench& bench) { return (bench.last.flags & protocol::kFlagSensorFault) != 0; }

TEST_CASE("a hand that was still for long is followed from its first tenth of a millimeter on") {
  for (const FirmwareImage& image : {Image16(), Image8()}) {
    Bench bench({}, image);
    bench.device.SetHand([](double time_s) {
      HandState hand;
      hand.insertion_mm = 50 * std::clamp(time_s - 14, 0.0, 1.0);
      return hand;
    });
    bench.Start();
    bench.Run(13);
    CHECK(bench.device.sensor().mode() == SensorNavigation::Mode::kRun);
    CHECK(bench.last.surface_quality == 64);
    bench.Run(2);
    CHECK(bench.last.axial_counts == 2362);  // 50 mm at 1200 counts per inch
    CHECK(bench.device.sensor().lost_mm() == 0);
    CHECK(bench.Diagnostics().sensor_faults == 0);
    bench.CheckRules();
  }
}

HandState Stirring(double time_s, double end_s) {
  const double t = std::min(time_s, end_s);
  HandState hand;
  hand.insertion_mm = 60 * std::sin(1.7 * t);
  hand.rotation_rad = 9 * std::cos(0.9 * t);
  return hand;
}

/// Resets the sensor at random times; each is detected and reported, and costs no count.
void ResetAtRandom(const FirmwareImage& image, int cpi, bool with_srom, std::uint32_t seed) {
  CAPTURE(image.cpu_hz(), cpi, with_srom, seed);
  std::mt19937 random(seed);
  BenchOptions options;
  options.seed = seed;
  Bench bench(options, image);
  constexpr int kResets = 25;
  double end_s = 1e9;
  bench.device.SetHand([&end_s](double time_s) { return Stirring(time_s, end_s); });
  bench.Start();
  REQUIRE(bench.Configure(cpi, 20) == TransferStatus::kDone);
  bench.Run(0.05);
  for (int i = 0; i < kResets; ++i) {
    if (with_srom) bench.LoadSrom(TestSrom());
    bench.Run(0.001 * (100 + static_cast<double>(random() % 200)));
    bench.device.RunUntil(bench.device.now_us() + static_cast<double>(random() % 1000));
    REQUIRE_FALSE(Faulty(bench));
    // With an image, the next reading detects even a reset that ends at once.
    const double boot_us = with_srom && i % 2 ? 0 : -1;
    bench.device.sensor().ResetItself(bench.device.chip().now_us(), boot_us);
    bench.Run(0.003);
    REQUIRE(Faulty(bench));
    CHECK(((bench.last.flags & protocol::kFlagSromLost) != 0) == with_srom);
    int frames = 0;
    for (; Faulty(bench); ++frames) {
      bench.host.RunFrame();
      REQUIRE(frames < 120);
    }
  }
  end_s = bench.device.now_us() * 1e-6;
  bench.Run(0.1);
  CHECK(bench.last.axial_counts == bench.device.sensor().axial_counts());
  CHECK(bench.last.transverse_counts == bench.device.sensor().transverse_counts());
  CHECK(std::abs(bench.last.axial_counts) + std::abs(bench.last.transverse_counts) > 100);
  const protocol::DiagnosticsReport diagnostics = bench.Diagnostics();
  CHECK(diagnostics.sensor_resets == kResets);
  CHECK(diagnostics.sensor_faults == kResets);
  CHECK(diagnostics.sensor_fault_cause == protocol::kSensorReset);
  CHECK(bench.device.sensor().self_resets() == kResets);
  if (!with_srom) CHECK(bench.gaps == 0);
  bench.CheckRules();
}

TEST_CASE("a sensor that resets itself at random loses no count, and each is reported") {
  std::uint32_t seed = 1;
  for (const FirmwareImage& image : {Image16(), Image8()}) {
    for (const int cpi : {1200, 5000}) {
      for (const bool with_srom : {false, true}) ResetAtRandom(image, cpi, with_srom, seed++);
    }
  }
}

TEST_CASE("a reset of a sensor without an image is detected even before the next reading") {
  for (const int cpi : {1200, 5000}) {
    Bench bench;
    bench.device.SetHand([](double time_s) { return Stirring(time_s, 3); });
    bench.Start();
    REQUIRE(bench.Configure(cpi, 20) == TransferStatus::kDone);
    bench.Run(0.5);
    bench.device.sensor().ResetItself(bench.device.chip().now_us(), 0);
    int frames = 0;
    for (; !Faulty(bench); ++frames) {
      bench.host.RunFrame();
      REQUIRE(frames < 200);
    }
    bench.Run(0.2);
    CHECK_FALSE(Faulty(bench));
    CHECK(bench.Diagnostics().sensor_resets == 1);
    CHECK(bench.device.sensor().cpi() == cpi);
  }
}

TEST_CASE("a frozen sensor is detected, and started again until it takes frames") {
  Bench bench;
  bench.Start();
  bench.Run(0.3);
  bench.device.sensor().SetFault(VirtualPmw3360::Fault::kFrozen);
  int frames = 0;
  for (; !Faulty(bench); ++frames) {
    bench.host.RunFrame();
    REQUIRE(frames < 250);
  }
  CHECK(bench.Diagnostics().sensor_fault_cause == protocol::kSensorFrozen);
  bench.device.sensor().SetFault(VirtualPmw3360::Fault::kNone);
  bench.Run(0.5);
  CHECK_FALSE(Faulty(bench));
  CHECK(bench.Diagnostics().sensor_observation == 0x3f);
  bench.CheckRules();
}

TEST_CASE("the cause of a fault is reported") {
  using Fault = VirtualPmw3360::Fault;
  for (const auto& [fault, cause] : {std::pair{Fault::kSilent, protocol::kSensorSilent},
                                     std::pair{Fault::kShorted, protocol::kSensorSilent},
                                     std::pair{Fault::kForeign, protocol::kSensorForeign}}) {
    Bench bench;
    bench.Start();
    bench.device.sensor().SetFault(fault);
    bench.Run(2);
    CHECK(Faulty(bench));
    CHECK(bench.Diagnostics().sensor_fault_cause == cause);
    CHECK(bench.Diagnostics().sensor_resets == 0);
  }
}

TEST_CASE("a firmware image reaches the sensor byte for byte, without a pause") {
  for (const FirmwareImage& image : {Image16(), Image8()}) {
    CAPTURE(image.cpu_hz());
    Bench bench({}, image);
    bench.device.SetHand([](double time_s) { return Stirring(time_s, 2); });
    bench.Start();
    bench.Run(0.3);
    bench.device.sensor().ExpectSrom(TestSrom());
    const double begin_us = bench.device.now_us();
    bench.LoadSrom(TestSrom());
    CHECK(bench.device.now_us() - begin_us < 400000);
    CHECK(bench.device.sensor().srom() == TestSrom());
    CHECK(bench.device.sensor().longest_burst_gap_us() < 80);
    CHECK(bench.Diagnostics().srom_id == 0x05);
    CHECK(bench.Diagnostics().sensor_observation == 0x7f);
    bench.Run(2);
    CHECK_FALSE(bench.last.flags & (protocol::kFlagSensorFault | protocol::kFlagSromLost));
    CHECK(bench.last.axial_counts == bench.device.sensor().axial_counts());
    CHECK(bench.Diagnostics().sensor_faults == 0);
    CHECK(bench.device.chip().resets() == 0);
    bench.CheckRules();
  }
}

// Some controllers serve endpoint 0 once per frame. The device buffers enough before it begins, so
// the burst continues without a pause.
TEST_CASE("an image from a host that sends a packet a frame has no pause either") {
  for (const FirmwareImage& image : {Image16(), Image8()}) {
    CAPTURE(image.cpu_hz());
    Bench bench({}, image);
    bench.Start();
    UsbController& usb = bench.device.usb();
    constexpr std::uint8_t kAddress = 1;  // first address of this host
    unsigned frame = 0;
    const auto run_frame = [&] {
      usb.StartOfFrame(++frame);
      bench.device.chip().UpdateUsbInterrupts();
      bench.device.RunUntil(bench.device.now_us() + 1000);
    };
    const std::uint8_t setup[8] = {0x21, 9, 6, 3, 0, 0, 0xff, 0x0f};
    REQUIRE(usb.Setup(kAddress, setup) == UsbAnswer::kAck);
    run_frame();
    std::vector<std::uint8_t> report(1, protocol::kSromReportId);
    report.resize(1 + protocol::kSromBytes, 0x05);
    std::size_t sent = 0;
    for (int i = 0; i < 500 && sent < report.size(); ++i, run_frame()) {
      const std::size_t size = std::min<std::size_t>(32, report.size() - sent);
      const UsbAnswer answer = usb.Out(kAddress, 0, {report.data() + sent, size});
      if (answer == UsbAnswer::kAck) sent += size;
    }
    CHECK(sent == report.size());
    std::vector<std::uint8_t> status;
    UsbAnswer answer = UsbAnswer::kNak;
    for (int i = 0; i < 200 && answer == UsbAnswer::kNak; ++i, run_frame()) {
      answer = usb.In(kAddress, 0, &status);
    }
    CHECK(answer == UsbAnswer::kAck);
    CHECK(bench.device.sensor().srom().size() == protocol::kSromBytes);
    CHECK(bench.device.sensor().longest_burst_gap_us() < 80);
    bench.CheckRules();
  }
}

TEST_CASE("an image that the sensor does not take is refused, and the sensor runs without") {
  Bench bench;
  bench.Start();
  std::vector<std::uint8_t> report(protocol::kLongestReportBytes);
  report[0] = protocol::kSromReportId;
  SECTION("spoiled") {
    bench.device.sensor().ExpectSrom(TestSrom());
    std::vector<std::uint8_t> spoiled = TestSrom();
    spoiled[77] ^= 4;
    std::copy(spoiled.begin(), spoiled.end(), report.begin() + 1);
    CHECK(bench.host.SetFeature(report).status == TransferStatus::kStall);
    CHECK(bench.Diagnostics().sensor_fault_cause == protocol::kSensorSromRefused);
  }
  SECTION("too short") {
    report.pop_back();
    CHECK(bench.host.SetFeature(report).status == TransferStatus::kStall);
    CHECK(bench.Diagnostics().sensor_faults == 0);
  }
  SECTION("while the sensor does not answer") {
    bench.device.sensor().SetFault(VirtualPmw3360::Fault::kSilent);
    bench.Run(0.1);
    CHECK(bench.host.SetFeature(report).status == TransferStatus::kStall);
    bench.device.sensor().SetFault(VirtualPmw3360::Fault::kNone);
  }
  bench.Run(2);
  CHECK_FALSE(Faulty(bench));
  CHECK(bench.Diagnostics().srom_id == 0);
  bench.LoadSrom(TestSrom());
  bench.CheckRules();
}

TEST_CASE("an image is lost with the sensor's power, and the reports show it until it is loaded") {
  Bench bench;
  bench.Start();
  bench.LoadSrom(TestSrom());
  bench.host.Suspend();
  bench.Run(0.2);
  bench.host.Resume();
  bench.Run(0.3);
  CHECK_FALSE(Faulty(bench));
  CHECK((bench.last.flags & protocol::kFlagSromLost) != 0);
  CHECK(bench.Diagnostics().srom_id == 0);
  bench.LoadSrom(TestSrom());
  bench.Run(0.05);
  CHECK_FALSE(bench.last.flags & protocol::kFlagSromLost);
  bench.CheckRules();
}

protocol::PictureReport Picture(Bench& bench) {
  const ControlResult result = bench.host.Control(
      {0xa1, 1, 0x0300 | protocol::kPictureReportId, 0, sizeof(protocol::PictureReport)});
  REQUIRE(result.status == TransferStatus::kDone);
  REQUIRE(result.data.size() == sizeof(protocol::PictureReport));
  protocol::PictureReport picture;
  std::memcpy(&picture, result.data.data(), sizeof(picture));
  return picture;
}

TEST_CASE("the picture is that of the camera; after it the count continues") {
  for (const FirmwareImage& image : {Image16(), Image8()}) {
    Bench bench({}, image);
    bench.device.SetHand([](double time_s) {
      HandState hand;
      hand.insertion_mm = time_s < 2.5 ? 3 : 13;
      hand.rotation_rad = 0.4;
      return hand;
    });
    SurfaceOptics optics;
    optics.distance_mm = 2.45;
    optics.dirt = 0.1;
    bench.device.sensor().SetOptics(optics);
    bench.Start();
    const double begin_us = bench.device.now_us();
    for (int i = 0; i < 3; ++i) {
      const protocol::PictureReport picture = Picture(bench);
      CHECK(picture.protocol_version == protocol::kProtocolVersion);
      CHECK(picture.surface_quality == SurfaceQuality(optics));
      CHECK(picture.shutter == 0x60);
      const SurfacePicture seen = RenderSurface(-0.4 * 5, 3, optics, BenchOptions().seed);
      CHECK(std::equal(seen.begin(), seen.end(), std::begin(picture.pixels)));
      bench.Run(0.1);
      CHECK_FALSE(Faulty(bench));
    }
    CHECK(bench.device.now_us() - begin_us < 1.3e6);
    CHECK(bench.last.axial_counts == 0);
    bench.Run(2.6 - bench.device.now_us() * 1e-6);
    // 10 mm, of which the height of 2.45 mm takes 0.4 %.
    CHECK(bench.last.axial_counts == 471);
    CHECK(bench.Diagnostics().sensor_faults == 0);
    CHECK(bench.device.chip().resets() == 0);
    bench.CheckRules();
  }
}

TEST_CASE("a missing sensor gives no picture, and a picture removes the firmware image") {
  Bench bench;
  bench.Start();
  bench.LoadSrom(TestSrom());
  Picture(bench);
  bench.Run(0.1);
  CHECK((bench.last.flags & protocol::kFlagSromLost) != 0);
  bench.device.sensor().SetFault(VirtualPmw3360::Fault::kSilent);
  bench.Run(0.1);
  CHECK(bench.host.Control({0xa1, 1, 0x0307, 0, 1302}).status == TransferStatus::kStall);
  bench.CheckRules();
}

TEST_CASE("a sensor that fails while its picture is taken ends the request") {
  Bench bench;
  bench.Start();
  bench.Run(0.4);
  TransferStatus status = TransferStatus::kDone;
  bool over = false;
  bench.host.Submit({0xa1, 1, 0x0307, 0, 1302}, {}, [&](const ControlResult& result) {
    status = result.status;
    over = true;
  });
  bench.device.sensor().SetFault(VirtualPmw3360::Fault::kSilent);
  bench.Run(0.5);
  // The picture was a row of ones, or the firmware detected the silence before.
  CHECK(over);
  bench.device.sensor().SetFault(VirtualPmw3360::Fault::kNone);
  bench.Run(2);
  CHECK_FALSE(Faulty(bench));
}

TEST_CASE("with a PMW3389 in its place, no count is lost and no rule broken") {
  for (const int cpi : {1200, 5000, 12000}) {
    BenchOptions options;
    options.sensor_kind = SensorKind::kPmw3389;
    Bench bench(options);
    bench.device.SetHand([](double time_s) {
      HandState hand;
      hand.insertion_mm = 20 * std::clamp(time_s - 1, 0.0, 1.0);
      hand.rotation_rad = -0.3 * hand.insertion_mm;
      return hand;
    });
    bench.Start();
    const auto identity = bench.Get<protocol::IdentityReport>(protocol::kIdentityReportId);
    CHECK(identity.sensor_product_id == 0x47);
    CHECK((identity.self_test & 4) != 0);
    REQUIRE(bench.Configure(cpi, 20) == TransferStatus::kDone);
    while (bench.device.now_us() < 2.2e6) bench.host.RunFrame();
    CAPTURE(cpi);
    CHECK(bench.device.sensor().cpi() == cpi);
    CHECK(bench.last.axial_counts == bench.device.sensor().axial_counts());
    CHECK(bench.last.transverse_counts == bench.device.sensor().transverse_counts());
    CHECK(std::abs(bench.last.axial_counts - 20 / 25.4 * cpi) <= 1);
    CHECK(bench.gaps == 0);
    // A spontaneous reset is noticed, and the resolution set again.
    bench.device.sensor().ResetItself(bench.device.chip().now_us());
    bench.Run(0.5);
    CHECK(bench.device.sensor().cpi() == cpi);
    CHECK(bench.Diagnostics().sensor_resets == 1);
    bench.CheckRules();
  }
}

}  // namespace
}  // namespace torquer::emulator
