// Automatic exposure: current of the tube, dose of each mode, and the noise that follows from both.
#include <catch2/catch.hpp>
#include <cmath>
#include <string>

#include "host/simulator/simulation.h"
#include "tests/effects/vascular_scene.h"

using torquer::effects::ImageSource;
using torquer::effects::Imaging;
using torquer::simulator::Command;
using torquer::simulator::Simulation;
using torquer::test::kStraight;
using torquer::test::Reading;
using torquer::test::SceneOf;

namespace {

constexpr double kPlainGain = 2;
constexpr double kSubtractedGain = 3;  // a subtraction has 1.5 times the gain

// A picture without body and wire: an even gray with noise. 5000 photons a pixel.
std::string Even(const std::string& more) {
  return kStraight +
         "attenuation_1_mm = 0\n[effects.fluoroscopy]\nbody_width_mm = 0\ngain = 2\n"
         "width_px = 256\nheight_px = 256\nphotons = 5000\n" +
         more;
}

Imaging In(Imaging::Mode mode, double magnification = 1) {
  Imaging imaging;
  imaging.mode = mode;
  imaging.magnification = magnification;
  return imaging;
}

void Tick(Simulation& session, double time_s, const Imaging& imaging, bool xray = true) {
  Command command;
  command.target[0].insertion_mm = 40;
  command.time_s = time_s;
  command.controls.xray = xray;
  command.controls.imaging = imaging;
  torquer::CountedBudget budget(3000);
  session.Tick(command, budget);
}

// Variance of the logarithm of the counts in the newest picture.
double VarianceOf(Simulation& session, double gain) {
  ImageSource::Picture picture;
  session.image()->Render(picture);
  const auto count = static_cast<double>(picture.gray.size());
  double mean = 0;
  double square = 0;
  for (const std::uint8_t gray : picture.gray) {
    mean += gray / count;
    square += static_cast<double>(gray) * gray / count;
  }
  // Quantization adds a variance of 1/12.
  return (square - mean * mean - 1.0 / 12) / std::pow(255 * gain, 2);
}

// Air kerma of one pulse with the tube's default output and pulse, 600 mm from the tube.
double PulseMGy(double tube_mA) { return 0.06 * tube_mA * 8e-3 / (0.6 * 0.6); }

}  // namespace

TEST_CASE("Subtraction and cine have the dose and the noise of an acquisition", "[effects]") {
  SceneOf scene(Even("acquisition_dose = 4\n"));
  Simulation session(*scene);
  Tick(session, 0.001, In(Imaging::Mode::kPlain));
  CHECK(VarianceOf(session, kPlainGain) == Approx(1 / 5000.0).epsilon(0.04));
  CHECK(Reading(session, "air_kerma_mGy") == Approx(PulseMGy(10)));
  Tick(session, 0.1, In(Imaging::Mode::kSubtraction));
  CHECK(VarianceOf(session, kSubtractedGain) == Approx(2 / 20000.0).epsilon(0.04));
  CHECK(Reading(session, "air_kerma_mGy") == Approx(PulseMGy(10) + PulseMGy(40)));
  CHECK(Reading(session, "tube_mA") == Approx(40));
  Tick(session, 0.15, In(Imaging::Mode::kCine));
  CHECK(VarianceOf(session, kPlainGain) == Approx(1 / 20000.0).epsilon(0.04));
  CHECK(Reading(session, "air_kerma_mGy") == Approx(PulseMGy(10) + 2 * PulseMGy(40)));
  CHECK(Reading(session, "picture_mode") == 3);
  // A road map is fluoroscopy. The mask of the acquisition has less noise than its pictures.
  Tick(session, 0.22, In(Imaging::Mode::kRoadmap));
  CHECK(VarianceOf(session, kSubtractedGain) == Approx(1 / 5000.0 + 1 / 20000.0).epsilon(0.04));
  CHECK(Reading(session, "air_kerma_mGy") == Approx(2 * PulseMGy(10) + 2 * PulseMGy(40)));
}

TEST_CASE("At the limit of the tube's current the dose stays and the noise grows", "[effects]") {
  SceneOf scene(Even("tube_limit_mA = 40\n"));
  Simulation session(*scene);
  // The current for a narrower field: 10, 40 and 90 mA.
  double sum_mGy = 0;
  double time_s = 0.001;
  for (const double magnification : {1.0, 2.0, 3.0}) {
    Tick(session, time_s, In(Imaging::Mode::kPlain, magnification));
    const double wanted_mA = 10 * magnification * magnification;
    const double tube_mA = std::fmin(wanted_mA, 40);
    INFO(magnification);
    CHECK(Reading(session, "tube_mA") == Approx(tube_mA));
    sum_mGy += PulseMGy(tube_mA);
    CHECK(Reading(session, "air_kerma_mGy") == Approx(sum_mGy));
    const double photons = 5000 * tube_mA / wanted_mA;
    CHECK(VarianceOf(session, kPlainGain) == Approx(1 / photons).epsilon(0.04));
    time_s += 0.07;
  }
}

TEST_CASE("The tube's figures are those of the newest pulse, and the rate is that of now",
          "[effects]") {
  SceneOf scene(Even("tube_kV = 72\nsid_mm = 1100\n"));
  Simulation session(*scene);
  Imaging imaging = In(Imaging::Mode::kPlain);
  Tick(session, 0.001, imaging, false);
  CHECK(std::isnan(Reading(session, "tube_mA")));
  CHECK(Reading(session, "tube_kV") == 72);
  CHECK(Reading(session, "source_detector_mm") == 1100);
  CHECK(Reading(session, "air_kerma_rate_mGy_min") == 0);
  Tick(session, 0.1, imaging);
  CHECK(Reading(session, "tube_mA") == Approx(10));
  CHECK(Reading(session, "air_kerma_rate_mGy_min") == Approx(PulseMGy(10) * 15 * 60));
  imaging.pulses_per_s = 7.5;
  Tick(session, 0.2, imaging);
  CHECK(Reading(session, "air_kerma_rate_mGy_min") == Approx(PulseMGy(10) * 7.5 * 60));
  Tick(session, 0.3, imaging, false);
  CHECK(Reading(session, "air_kerma_rate_mGy_min") == 0);
  CHECK(Reading(session, "tube_mA") == Approx(10));
  session.Restart();
  CHECK(std::isnan(Reading(session, "tube_mA")));
}
