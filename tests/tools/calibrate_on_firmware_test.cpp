// torquer-calibrate with the firmware's image in the emulator, whose sensor is askew, scaled and on
// another cylinder than drawn. Time is elastic: the device waits for the program.
#include <atomic>
#include <catch2/catch.hpp>
#include <cstdio>
#include <fstream>
#include <numbers>
#include <optional>
#include <random>
#include <thread>

#include "calibration/calibration_file.h"
#include "host/emulator/emulator_run.h"
#include "tests/support/child_process.h"
#include "tests/support/paths.h"
#include "tests/support/temporary_folder.h"

namespace {

using Catch::Contains;
using torquer::calibration::Calibration;
using torquer::calibration::MotionParameters;
using torquer::calibration::ParametersOf;
using torquer::emulator::EmulatorRun;
using torquer::emulator::RunOptions;
using torquer::emulator::RunSummary;
using torquer::test::ChildProcess;
using torquer::test::TemporaryFolder;

const std::string kProgram = torquer::test::ProgramPath("torquer-calibrate");
constexpr double kDegree = std::numbers::pi / 180.0;
constexpr double kTurns = 4.0 * std::numbers::pi;
constexpr double kMmPerInch = 25.4;

// Hand motion as a motion file.
class MotionFile {
 public:
  MotionFile() { Row(); }
  void Rest(double seconds) {
    time_s_ += seconds;
    Row();
  }
  // Moves there in 0.2 s, and rests for the duration of a mark.
  void Go(double insertion_mm, double rotation_rad) {
    insertion_mm_ = insertion_mm;
    rotation_rad_ = rotation_rad;
    Rest(0.2);
    Rest(0.4);
  }
  void Stick(double x, double y) {
    x_ = x;
    y_ = y;
    Rest(0.05);
    Rest(0.35);
  }
  // The motion goes to the catheter's cylinder; the wire moves in another way.
  void MoveCatheter() { catheter_ = true, rows_.clear(), Row(); }
  void Write(const std::string& path) const {
    std::ofstream(path) << "time_s,insertion_mm,rotation_rad,joystick_x,joystick_y,buttons"
                        << (catheter_ ? ",catheter_insertion_mm,catheter_rotation_rad\n" : "\n")
                        << rows_;
  }
  double time_s() const { return time_s_; }

 private:
  void Row() {
    char row[160];
    std::snprintf(row, sizeof row, "%.3f,%.4f,%.6f,%g,%g,\n", time_s_, insertion_mm_, rotation_rad_,
                  x_, y_);
    if (catheter_) {
      std::snprintf(row, sizeof row, "%.3f,%.4f,%.6f,%g,%g,,%.4f,%.6f\n", time_s_,
                    60.0 - 0.3 * insertion_mm_, 0.2 * rotation_rad_, x_, y_, insertion_mm_,
                    rotation_rad_);
    }
    rows_ += row;
  }
  bool catheter_ = false;
  double time_s_ = 0, insertion_mm_ = 0, rotation_rad_ = 0, x_ = 0, y_ = 0;
  std::string rows_;
};

struct Bench {
  explicit Bench(const MotionFile& motion, RunOptions options = {}) {
    motion.Write(folder.Path("motion.csv"));
    if (options.firmware.empty()) {
      options.firmware = torquer::test::FirmwarePath("torquer-firmware.elf");
    }
    options.motion = folder.Path("motion.csv");
    options.socket = folder.Path("socket");
    options.use_lcm = false;
    options.fast = true;
    options.wait_client = true;
    options.bench.serial = "CAL-1";
    run_.emplace(options);
    thread_ = std::thread([this] { summary = run_->Run(stop_); });
  }
  ~Bench() { Stop(); }
  void Stop() {
    stop_ = true;
    if (thread_.joinable()) thread_.join();
  }
  int Calibrate(const std::string& script, const std::vector<std::string>& more) {
    std::ofstream(folder.Path("a.script")) << "torquer-calibrate script 1\n" << script;
    std::vector<std::string> words{kProgram,
                                   "--source",
                                   "socket",
                                   "--socket",
                                   folder.Path("socket"),
                                   "--script",
                                   folder.Path("a.script"),
                                   "--output",
                                   folder.Path("calibration.toml")};
    words.insert(words.end(), more.begin(), more.end());
    ChildProcess program(words);
    const int status = program.Wait();
    said = program.Output() + program.Error();
    Stop();
    return status;
  }
  Calibration Result() const {
    return torquer::calibration::ReadCalibration(folder.Path("calibration.toml"));
  }

  TemporaryFolder folder;
  std::string said;
  RunSummary summary;

 private:
  std::atomic<bool> stop_ = false;
  std::optional<EmulatorRun> run_;
  std::thread thread_;
};

std::string Marks(int count) {
  std::string text;
  for (int i = 0; i < count; ++i) text += "mark\n";
  return text;
}

}  // namespace

TEST_CASE("A dozen devices, built otherwise than drawn, are found out through the firmware") {
  const auto device = GENERATE(range(0, 12));
  const std::uint64_t seed = 100 + static_cast<std::uint64_t>(device);
  CAPTURE(seed);
  std::mt19937_64 random(seed);
  std::uniform_real_distribution<double> unit(-1.0, 1.0);
  RunOptions options;
  options.bench.sensor.misalignment_rad = 6.0 * kDegree * unit(random);
  options.bench.sensor.scale = 1.0 + 0.08 * unit(random);
  options.bench.cylinder_radius_mm = 5.0 + 0.7 * unit(random);

  MotionFile motion;
  motion.Rest(2.0);
  for (int i = 0; i < 3; ++i) {
    motion.Go(150.0, 0.0);
    motion.Go(0.0, 0.0);
  }
  for (int i = 0; i < 3; ++i) {
    motion.Go(0.0, kTurns);
    motion.Go(0.0, 0.0);
  }
  motion.Rest(1.0);
  Bench bench(motion, options);
  const int status = bench.Calibrate(Marks(7) + "skip raised\n" + Marks(7) + "skip joystick\n",
                                     {"--pushes", "3", "--turn-strokes", "3", "--play", "0"});
  CAPTURE(bench.said);
  REQUIRE(status == 0);
  CHECK(bench.summary.violations == 0);
  const Calibration calibration = bench.Result();
  CHECK(calibration.device == "CAL-1");
  CHECK(calibration.motion.cpi == 1200);
  const MotionParameters found = ParametersOf(calibration.motion);
  const double gain = kMmPerInch / 1200 / options.bench.sensor.scale;
  const double radius = options.bench.cylinder_radius_mm;
  CHECK(found.gain_mm_per_count == Approx(gain).epsilon(0.001));
  // A sensor rotated one way sees the surface move the other way.
  CHECK(found.misalignment_rad / kDegree ==
        Approx(-options.bench.sensor.misalignment_rad / kDegree).margin(0.05));
  // Degrees that the model computes for the surface length of one full turn.
  const double found_turn_deg =
      360.0 * radius / gain * found.gain_mm_per_count / found.cylinder_radius_mm;
  CHECK(found_turn_deg == Approx(360.0).margin(0.2));
}

TEST_CASE("The second sensor of a box gets its own calibration") {
  RunOptions options;
  options.firmware = torquer::test::FirmwarePath("torquer-firmware-two-sensors.elf");
  options.bench.sensor.scale = 1.05;
  MotionFile motion;
  motion.MoveCatheter();
  motion.Rest(2.0);
  for (int i = 0; i < 6; ++i) {
    motion.Go(i < 3 ? 150.0 : 0.0, i < 3 ? 0.0 : kTurns);
    motion.Go(0.0, 0.0);
  }
  motion.Rest(1.0);
  Bench bench(motion, options);
  const int status =
      bench.Calibrate(Marks(7) + "skip raised\n" + Marks(7) + "skip joystick\n",
                      {"--sensor", "2", "--pushes", "3", "--turn-strokes", "3", "--play", "0"});
  CAPTURE(bench.said);
  REQUIRE(status == 0);
  CHECK(bench.summary.violations == 0);
  const Calibration calibration = bench.Result();
  CHECK(calibration.device == "CAL-1.2");
  const MotionParameters found = ParametersOf(calibration.motion);
  CHECK(found.gain_mm_per_count == Approx(kMmPerInch / 1200 / 1.05).epsilon(0.001));
  CHECK(found.cylinder_radius_mm == Approx(5.0).epsilon(0.002));
}

TEST_CASE("A device with one sensor has no second one to calibrate") {
  MotionFile motion;
  motion.Rest(2.0);
  Bench bench(motion);
  CHECK(bench.Calibrate(Marks(1), {"--sensor", "2"}) == 2);
  CHECK_THAT(bench.said, Contains("the device 'CAL-1' has one sensor"));
}

TEST_CASE("All steps, a lifted push, noise and the joystick, through the firmware") {
  RunOptions options;
  options.bench.sensor.misalignment_rad = 2.0 * kDegree;
  options.bench.sensor.noise_counts = 0.1;
  MotionFile motion;
  motion.Rest(3.0);
  for (int i = 0; i < 4; ++i) {
    if (i == 1) options.lifts.push_back({motion.time_s() + 0.1, 0.05});
    motion.Go(150.0, 0.0);
    motion.Go(0.0, 0.0);
  }
  // Raised by 0.15 mm, the surface moves by 1.2 % more counts.
  options.bench.play_mm = 0.15;
  const double raised_s = motion.time_s() - 0.2;
  motion.Rest(0.4);
  for (int i = 0; i < 3; ++i) {
    motion.Go(150.0, 0.0);
    motion.Go(0.0, 0.0);
  }
  options.raises.push_back({raised_s, motion.time_s() - 0.2 - raised_s});
  motion.Rest(0.4);
  for (int i = 0; i < 3; ++i) {
    motion.Go(0.0, kTurns);
    motion.Go(0.0, 0.0);
  }
  for (const auto& [x, y] : {std::pair{0.9, 0.0}, {-0.8, 0.0}, {0.0, 0.7}, {0.0, -1.0}}) {
    motion.Stick(x, y);
    motion.Stick(0.0, 0.0);
  }
  motion.Rest(1.0);
  Bench bench(motion, options);
  const int status =
      bench.Calibrate(Marks(1 + 8 + 1 + 6 + 1 + 6), {"--pushes", "3", "--turn-strokes", "3"});
  CAPTURE(bench.said);
  REQUIRE(status == 0);
  CHECK_THAT(bench.said, Contains("ok raised push 3"));
  CHECK_THAT(bench.said, Contains("Raised, the cylinder counts +1.2 %: reduce its play"));
  CHECK_THAT(bench.said, Contains("push 2 is not used: the sensor was lifted"));
  CHECK_THAT(bench.said, Contains("ok push 4"));
  const Calibration calibration = bench.Result();
  CHECK(calibration.lao.maximum == Approx(512 + 0.9 * 511).margin(4));
  CHECK(calibration.lao.minimum == Approx(512 - 0.8 * 512).margin(4));
  CHECK(calibration.cra.maximum == Approx(512 + 0.7 * 511).margin(4));
  CHECK(calibration.cra.minimum == Approx(0).margin(4));
  CHECK_THAT(calibration.note, Contains("height measured, joystick measured"));
}
