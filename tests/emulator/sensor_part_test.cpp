// Virtual PMW3360 compared with its data sheet: its own behavior, and the misuse that it must
// detect.
#include <catch2/catch.hpp>
#include <cmath>
#include <numeric>

#include "host/emulator/pmw3360.h"
#include "tests/emulator/sensor_speaker.h"

namespace torquer::emulator {
namespace {

constexpr int kMotion = 0x02, kConfig1 = 0x0f, kConfig2 = 0x10, kFrameCapture = 0x12,
              kSromEnable = 0x13, kObservation = 0x24, kSromId = 0x2a, kReset = 0x3a;

/// Sensor set up as by a driver, over a surface whose motion the test defines.
struct Moving : SensorSpeaker {
  explicit Moving(const SensorImperfections& imperfections = {}) : SensorSpeaker(imperfections) {
    sensor.SetSurface([this](double us) { return SurfacePosition{position(us * 1e-6), 0}; });
  }
  void SetUp(int cpi) {
    Write(kConfig1, cpi / 100 - 1);
    Write(0x50, 0);
    Burst();
  }
  /// Reads every millisecond, as the firmware does; returns the sum of the counts.
  int Follow(double seconds) {
    int counts = 0;
    const double end_us = now_us + seconds * 1e6;
    while (now_us < end_us) {
      const double next_us = now_us + 1000;
      Burst();
      counts += static_cast<std::int16_t>(burst[4] | burst[5] << 8);
      now_us = next_us;
    }
    return counts;
  }
  std::function<double(double time_s)> position = [](double) { return 0.0; };
};

TEST_CASE("the sensor wakes with the reset values of its data sheet, by power and by command") {
  const std::pair<int, int> values[] = {
      {0x00, 0x42}, {0x02, 0x20}, {0x0f, 0x31}, {0x10, 0x20}, {0x14, 0x32}, {0x15, 0x00},
      {0x17, 0x1f}, {0x18, 0x63}, {0x1a, 0xbc}, {0x1b, 0xf3}, {0x1c, 0x01}, {0x2a, 0x00},
      {0x2b, 0x10}, {0x2c, 0x0a}, {0x2f, 0x31}, {0x3f, 0xbd}, {0x63, 0x02}};
  SensorSpeaker speaker;
  for (int round = 0; round < 2; ++round) {
    for (const auto& [address, value] : values) {
      // A read of the Motion register latches it: it shows run mode and no motion.
      const int wanted = address == kMotion ? 0x00 : value;
      CAPTURE(address);
      CHECK(speaker.Read(address) == wanted);
    }
    CHECK(speaker.sensor.cpi() == 5000);
    for (const int address : {0x0f, 0x10, 0x14, 0x17, 0x2b}) speaker.Write(address, 0x01);
    speaker.Write(kReset, 0x5a);
    speaker.now_us += 50000;
  }
  CHECK(speaker.Violation().empty());
  speaker.Write(0x00, 0x01);
  CHECK_THAT(speaker.Violation(), Catch::Contains("read only"));
}

TEST_CASE(
    "left as it wakes, a still sensor rests after half a second, deeper after 10 s and 10 min") {
  using Mode = SensorNavigation::Mode;
  Moving sensor;
  sensor.SetUp(1200);
  const auto mode_after = [&sensor](double seconds) {
    sensor.Follow(seconds);
    return sensor.sensor.mode();
  };
  CHECK(mode_after(0.45) == Mode::kRun);
  CHECK(sensor.burst[6] == 64);
  CHECK(mode_after(0.1) == Mode::kRest1);
  CHECK((sensor.burst[0] & 0x06) == 0x02);
  CHECK(sensor.burst[6] == 0);  // valid in run mode only
  CHECK(mode_after(9.8) == Mode::kRest1);
  CHECK(mode_after(0.2) == Mode::kRest2);
  CHECK((sensor.burst[0] & 0x06) == 0x04);
  CHECK(mode_after(600) == Mode::kRest2);
  CHECK(mode_after(4) == Mode::kRest3);
  CHECK((sensor.burst[0] & 0x06) == 0x06);
  sensor.Write(kConfig2, 0x00);
  sensor.Write(0x50, 0);
  CHECK(mode_after(30) == Mode::kRun);
  CHECK(sensor.burst[6] == 64);
  CHECK(sensor.Violation().empty());
}

TEST_CASE("motion during rest is lost for up to a frame's time; awake no motion is lost") {
  for (const bool rests : {true, false}) {
    for (const double speed_mm_s : {2.0, 50.0}) {
      CAPTURE(rests, speed_mm_s);
      Moving sensor;
      const double start_s = 15;
      sensor.position = [=](double time_s) { return speed_mm_s * std::max(0.0, time_s - start_s); };
      if (!rests) sensor.Write(kConfig2, 0x00);
      sensor.SetUp(1200);
      const double counts = sensor.Follow(start_s + 1 - sensor.now_us * 1e-6);
      const double moved_mm = counts * 25.4 / 1200;
      // In rest mode, frames come every 100 ms; the sensor still tracks 0.5 mm between two of them.
      const bool lost = rests && speed_mm_s == 50;
      if (lost) {
        CHECK(speed_mm_s - moved_mm > 0.5);
        CHECK(speed_mm_s - moved_mm <= 5.0);
        CHECK(sensor.sensor.lost_mm() == Approx(speed_mm_s - moved_mm).margin(0.1));
      } else {
        CHECK(moved_mm == Approx(speed_mm_s).margin(0.1));
        CHECK(sensor.sensor.lost_mm() == 0);
      }
      CHECK(sensor.sensor.mode() == SensorNavigation::Mode::kRun);
    }
  }
}

TEST_CASE("a hand that creeps keeps it awake") {
  Moving sensor;
  sensor.position = [](double time_s) { return 0.1 * time_s; };  // a count in 0.2 s
  sensor.SetUp(1200);
  CHECK(sensor.Follow(20) == Approx(2.0 / 25.4 * 1200).margin(1));
  CHECK(sensor.sensor.mode() == SensorNavigation::Mode::kRun);
  CHECK(sensor.sensor.lost_mm() == 0);
}

TEST_CASE("the bits of Observation appear in the next frame, and not without frames") {
  SensorSpeaker speaker;
  CHECK(speaker.Read(kObservation) == 0x3f);
  speaker.now_us = 110010;  // a frame has just begun
  speaker.Write(kObservation, 0);
  CHECK(speaker.Read(kObservation) == 0x00);
  speaker.now_us += 1000;
  CHECK(speaker.Read(kObservation) == 0x3f);
  speaker.sensor.SetFault(VirtualPmw3360::Fault::kFrozen);
  CHECK(speaker.Read(kObservation) == 0x3f);
  speaker.Write(kObservation, 0);
  speaker.now_us += 100000;
  CHECK(speaker.Read(kObservation) == 0x00);
}

TEST_CASE("a sensor that resets itself answers on with its defaults, and counts at 5000 cpi") {
  Moving sensor;
  sensor.position = [](double time_s) { return 10 * time_s; };
  sensor.Write(kConfig2, 0x00);
  sensor.SetUp(1200);
  sensor.Follow(0.5);
  const std::int64_t counted = sensor.sensor.axial_counts();
  CHECK(counted == Approx(5 / 25.4 * 1200).margin(1));
  sensor.sensor.ResetItself(sensor.now_us, 20000);
  sensor.Burst();
  CHECK(sensor.burst[1] == 0x00);
  CHECK(sensor.Follow(0.019) == 0);
  const int stray = sensor.Follow(0.5);
  CHECK(stray == Approx(5 / 25.4 * 5000).margin(60));
  CHECK(sensor.sensor.axial_counts() == counted);
  CHECK(sensor.sensor.stray_counts() > 900);
  CHECK(sensor.sensor.self_resets() == 1);
  // The firmware could not know of the reset, so no violation is recorded.
  CHECK(sensor.Violation().empty());
  CHECK(sensor.Read(kConfig2) == 0x20);
}

TEST_CASE("by itself it resets as often as set") {
  SensorImperfections often;
  often.self_reset_interval_s = 0.5;
  Moving sensor(often);
  sensor.Write(kConfig2, 0x00);
  sensor.SetUp(1200);
  sensor.Follow(60);
  CHECK(sensor.sensor.self_resets() > 70);
  CHECK(sensor.sensor.self_resets() < 150);
}

TEST_CASE("counts from before the resolution was set are discarded") {
  Moving sensor;
  sensor.position = [](double time_s) { return 100 * time_s; };
  sensor.now_us = 200000;  // 15 mm since the sensor's first frame
  sensor.SetUp(1200);
  CHECK(sensor.sensor.stray_counts() == Approx(15 / 25.4 * 5000).margin(60));
  CHECK(sensor.sensor.axial_counts() == 0);
  CHECK(sensor.sensor.counting());
}

std::vector<std::uint8_t> Image() {
  std::vector<std::uint8_t> image(4094);
  std::iota(image.begin(), image.end(), std::uint8_t{0});
  image[1] = 0x05;  // identification number of the image
  return image;
}

void Prepare(SensorSpeaker* speaker) {
  speaker->Write(kConfig2, 0x00);
  speaker->Write(kSromEnable, 0x1d);
  speaker->now_us += 10000;
  speaker->Write(kSromEnable, 0x18);
}

TEST_CASE("a firmware image is taken by the procedure of the data sheet") {
  SensorSpeaker speaker;
  Prepare(&speaker);
  speaker.LoadSrom(Image());
  CHECK(speaker.Read(kSromId) == 0x05);
  CHECK(speaker.sensor.srom() == Image());
  speaker.now_us += 1000;
  CHECK(speaker.Read(kObservation) == 0x7f);
  CHECK(speaker.Violation().empty());
  SECTION("and is lost by a reset") {
    speaker.Write(kReset, 0x5a);
    speaker.now_us += 50000;
    CHECK(speaker.Read(kSromId) == 0x00);
    CHECK(speaker.Read(kObservation) == 0x3f);
  }
  SECTION("without a request, too") {
    speaker.sensor.ResetItself(speaker.now_us, 0);
    speaker.now_us += 1000;
    CHECK(speaker.Read(kObservation) == 0x3f);
  }
}

TEST_CASE("an image that is too short, or spoiled, is not run") {
  SensorSpeaker speaker;
  Prepare(&speaker);
  std::vector<std::uint8_t> image = Image();
  SECTION("too short") { image.pop_back(); }
  SECTION("too long") { image.push_back(0); }
  SECTION("spoiled") {
    speaker.sensor.ExpectSrom(Image());
    image[2000] ^= 1;
  }
  speaker.LoadSrom(image);
  CHECK(speaker.Read(kSromId) == 0x00);
  CHECK(speaker.sensor.srom().empty());
}

TEST_CASE("each departure from the procedure for an image is named") {
  SensorSpeaker speaker;
  const char* named = "";
  SECTION("rest modes on") {
    speaker.Write(kSromEnable, 0x1d);
    named = "rest modes";
  }
  SECTION("no preparation") {
    speaker.LoadSrom(Image());
    named = "without 0x1d and 0x18";
  }
  SECTION("no time to prepare") {
    speaker.Write(kConfig2, 0x00);
    speaker.Write(kSromEnable, 0x1d);
    speaker.Write(kSromEnable, 0x18);
    named = "from 0x1d to 0x18";
  }
  SECTION("bytes too fast") {
    Prepare(&speaker);
    speaker.long_burst_us = 14;
    speaker.LoadSrom(Image());
    named = "time between SROM bytes";
  }
  SECTION("a pause") {
    Prepare(&speaker);
    speaker.pause_after = 3000;
    speaker.LoadSrom(Image());
    named = "a pause of";
  }
  SECTION("another register read first") {
    Prepare(&speaker);
    speaker.LoadSrom(Image());
    speaker.Read(0x00);
    named = "SROM_ID";
  }
  CHECK_THAT(speaker.Violation(), Catch::Contains(named));
}

TEST_CASE("a raw picture is what lies under the sensor, and ends its navigation") {
  SensorSpeaker speaker;
  speaker.sensor.SetSurface([](double) { return SurfacePosition{3.25, -1.5}; });
  SurfaceOptics optics;
  optics.distance_mm = 2.5;
  optics.side_shading = 1.3;
  speaker.sensor.SetOptics(optics);
  speaker.now_us += 250000;
  speaker.Write(kConfig2, 0x00);
  speaker.Write(kFrameCapture, 0x83);
  speaker.Write(kFrameCapture, 0xc5);
  speaker.now_us += 20000;
  const std::vector<std::uint8_t> picture = speaker.RawData(1296);
  const SurfacePicture wanted = RenderSurface(1.5, 3.25, optics, 1);
  CHECK(picture == std::vector<std::uint8_t>(wanted.begin(), wanted.end()));
  CHECK(speaker.Violation().empty());
  SECTION("until it is reset") {
    speaker.Write(kReset, 0x5a);
    speaker.now_us += 50000;
    speaker.Read(0x00);
    CHECK(speaker.Violation().empty());
  }
  SECTION("a reader of motion detects it") {
    speaker.Write(0x50, 0);
    CHECK_THAT(speaker.Violation(), Catch::Contains("without a reset"));
  }
}

TEST_CASE("each departure from the procedure for a picture is named") {
  SensorSpeaker speaker;
  const char* named = "";
  const auto ask = [&speaker] {
    speaker.Write(kConfig2, 0x00);
    speaker.Write(kFrameCapture, 0x83);
    speaker.Write(kFrameCapture, 0xc5);
  };
  SECTION("too soon after a reset") {
    ask();
    named = "from a reset";
  }
  speaker.now_us += 250000;
  SECTION("rest modes on") {
    speaker.Write(kFrameCapture, 0x83);
    named = "rest modes";
  }
  SECTION("no picture taken") {
    speaker.RawData(1296);
    named = "without a picture";
  }
  SECTION("no time to take it") {
    ask();
    speaker.RawData(1296);
    named = "to take a raw picture";
  }
  SECTION("cut off") {
    ask();
    speaker.now_us += 20000;
    speaker.RawData(1295);
    named = "1295 bytes";
  }
  SECTION("with a pause") {
    ask();
    speaker.now_us += 20000;
    speaker.pause_after = 700;
    speaker.RawData(1296);
    named = "a pause of";
  }
  SECTION("too soon after it") {
    ask();
    speaker.now_us += 20000;
    speaker.after_read_us = 3.9;
    speaker.RawData(1296);
    speaker.after_read_us = 20;
    speaker.Write(kReset, 0x5a);
    named = "tBEXIT (NCS high after raw data)";
  }
  CHECK_THAT(speaker.Violation(), Catch::Contains(named));
}

double Contrast(const SurfacePicture& picture) {
  double sum = 0;
  for (int row = 0; row < kPictureSide; ++row) {
    for (int column = 1; column < kPictureSide; ++column) {
      const int at = row * kPictureSide + column;
      sum += std::abs(int{picture[static_cast<std::size_t>(at)]} -
                      int{picture[static_cast<std::size_t>(at - 1)]});
    }
  }
  return sum;
}

double Mean(const SurfacePicture& picture, int from_row, int to_row) {
  const auto begin = picture.begin() + from_row * kPictureSide;
  const auto end = picture.begin() + to_row * kPictureSide;
  return std::accumulate(begin, end, 0.0) / static_cast<double>(end - begin);
}

TEST_CASE("counts follow the height of the surface as in figure 12 of the data sheet") {
  // Share of the counts for each millimeter of height; the figure goes from 2.1 to 2.7 mm.
  struct Surface {
    double slope, at_low, at_high;
  };
  for (const Surface& surface : {Surface{-0.13, 1.039, 0.961}, Surface{-0.028, 1.0084, 0.9916}}) {
    for (const auto& [distance_mm, share] :
         {std::pair{2.1, surface.at_low}, {2.4, 1.0}, {2.7, surface.at_high}}) {
      SensorNavigation navigation({}, 1);
      navigation.SetSurface([](double us) { return SurfacePosition{us * 1e-4, us * 0.5e-4}; });
      navigation.Restart(0);
      const SurfaceOptics optics{.distance_mm = distance_mm, .magnification_per_mm = surface.slope};
      SensorNavigation::Settings settings;
      settings.rest_enabled = false;
      settings.magnification = [&optics](double raised_mm) {
        return Magnification(optics, optics.distance_mm - raised_mm);
      };
      int x = 0, y = 0;
      for (int ms = 0; ms <= 254; ++ms) {
        navigation.Advance(1000.0 * ms, settings, false);
        const SensorNavigation::Counts counts = navigation.Take();
        x += counts.x;
        y += counts.y;
      }
      CHECK(y == Approx(5000 * share).margin(1));  // an inch at 5000 cpi
      CHECK(x == Approx(-2500 * share).margin(1));
    }
  }
}

TEST_CASE("a picture is sharp in focus, blurred out of it, and shows shading and dirt") {
  const SurfacePicture sharp = RenderSurface(0, 0, {}, 5);
  CHECK(*std::max_element(sharp.begin(), sharp.end()) <= 127);
  CHECK(Mean(sharp, 0, 36) == Approx(62).margin(6));
  double before = Contrast(sharp);
  for (const double distance_mm : {2.6, 2.8, 3.2}) {
    const double contrast = Contrast(RenderSurface(0, 0, {.distance_mm = distance_mm}, 5));
    CHECK(contrast < before);
    before = contrast;
  }
  const SurfacePicture shaded = RenderSurface(0, 0, {.side_shading = 1.7}, 5);
  CHECK(Mean(shaded, 30, 36) / Mean(shaded, 0, 6) == Approx(1.6).margin(0.25));
  const SurfacePicture dirty = RenderSurface(0, 0, {.dirt = 0.5}, 5);
  CHECK(Mean(dirty, 0, 36) < Mean(sharp, 0, 36) - 5);
  // Paper that moves by one pixel along y shifts the picture by one byte, along x by one line.
  const SurfaceOptics even{.lamp_shading = 1};
  const SurfacePicture still = RenderSurface(0, 0, even, 5);
  const SurfacePicture moved_x = RenderSurface(1.0 / 36, 0, even, 5);
  int same_lines = 0;
  for (std::size_t i = 0; i + kPictureSide < still.size(); ++i) {
    same_lines += moved_x[i] == still[i + kPictureSide];
  }
  CHECK(same_lines > 1200);
  const SurfacePicture moved = RenderSurface(0, 1.0 / 36, even, 5);
  int same = 0;
  for (std::size_t i = 0; i + 1 < sharp.size(); ++i) same += moved[i] == still[i + 1];
  CHECK(same > 1200);
  CHECK(RenderSurface(0, 0, {}, 6) != sharp);
}

}  // namespace
}  // namespace torquer::emulator
