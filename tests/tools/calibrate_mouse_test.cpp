// torquer-calibrate with an ordinary mouse, on unmodified libevdev in a mocked kernel. The events'
// time stamps are the device's clock, so the test does not wait for real time.
#include <catch2/catch.hpp>
#include <chrono>
#include <fstream>
#include <thread>

#include "calibration/calibration_file.h"
#include "host/bus/clock.h"
#include "tests/support/child_process.h"
#include "tests/support/evdev_testbed.h"
#include "tests/support/paths.h"
#include "tests/support/private_network.h"
#include "tests/support/temporary_folder.h"

namespace {

using Catch::Contains;
using torquer::calibration::Calibration;
using torquer::test::ChildProcess;
using torquer::test::EvdevScript;
using torquer::test::EvdevTestbed;
using torquer::test::TemporaryFolder;

const std::string kProgram = torquer::test::ProgramPath("torquer-calibrate");
constexpr int kMouse = 5;
constexpr auto kPatience = std::chrono::seconds(120);

EvdevScript Mouse() {
  EvdevScript script;
  script.name = "Mock mouse";
  script.keys = {BTN_LEFT, BTN_RIGHT, BTN_MIDDLE};
  script.relative_axes = {REL_X, REL_Y};
  return script;
}

// Hand that moves the mouse's counts and its clock.
class Hand {
 public:
  Hand(EvdevTestbed& testbed, const ChildProcess& program) : testbed_(testbed), program_(program) {}

  // Moves by these counts at once, then rests for half a second.
  void Move(int axial, int transverse) {
    Send(axial, transverse, 10000);
    for (int i = 0; i < 5; ++i) Send(0, 0, 100000);
  }
  // True once the program prints `text`. No events are sent meanwhile: the mocked file could
  // overflow.
  bool Until(const std::string& text) {
    const auto deadline = std::chrono::steady_clock::now() + kPatience;
    while (program_.Output().find(text) == std::string::npos) {
      if (std::chrono::steady_clock::now() > deadline) return false;
      std::this_thread::sleep_for(std::chrono::milliseconds(2));
    }
    return true;
  }

 private:
  void Send(int axial, int transverse, std::int64_t passed_us) {
    time_us_ += passed_us;
    testbed_.Send(kMouse, {{EV_REL, REL_X, axial}, {EV_REL, REL_Y, transverse}}, time_us_);
  }

  EvdevTestbed& testbed_;
  const ChildProcess& program_;
  // Ahead of real time: the source takes the later of real time and the device's time.
  std::int64_t time_us_ = torquer::bus::MonotonicUs() + 60000000;
};

}  // namespace

TEST_CASE("A mouse of any resolution is calibrated by its raw deltas") {
  torquer::test::NeedPrivateNetworkAndDevices();
  TemporaryFolder folder;
  EvdevTestbed testbed;
  const std::string mouse = testbed.Plug(kMouse, Mouse());
  std::ofstream script(folder.Path("a.script"));
  script << "torquer-calibrate script 1\n";
  for (int i = 0; i < 21; ++i) script << "mark\n";
  script.close();
  ChildProcess program({kProgram, "--source", "evdev", "--device", mouse, "--script",
                        folder.Path("a.script"), "--output", folder.Path("mouse.toml"), "--pushes",
                        "3", "--turn-strokes", "3"});
  Hand hand(testbed, program);
  CAPTURE(program.Error());
  REQUIRE(hand.Until("Device 046d:c077 at 1000 cpi (assumed until it is measured)"));
  CHECK(testbed.Grabbed(kMouse));
  for (int i = 0; i < 4; ++i) hand.Move(0, 0);  // at rest
  REQUIRE(hand.Until("straight to the far stop"));
  for (const char* counted : {"ok push 1", "ok push 2", "ok push 3"}) {
    hand.Move(9449, 165);  // 1600 counts per inch, askew by 1 degree
    REQUIRE(hand.Until("to the near stop"));
    hand.Move(-9449, -165);
    REQUIRE(hand.Until(counted));
  }
  hand.Move(0, 0);
  for (const char* counted : {"ok raised push 1", "ok raised push 2", "ok raised push 3"}) {
    hand.Move(9449, 165);
    REQUIRE(hand.Until("Still pressing upward, pull it back"));
    hand.Move(-9449, -165);
    REQUIRE(hand.Until(counted));
  }
  hand.Move(0, 0);
  for (const char* counted : {"ok turns 1", "ok turns 2", "ok turns 3"}) {
    hand.Move(-69, 3958);
    hand.Move(69, -3958);
    REQUIRE(hand.Until(counted));
  }
  REQUIRE(program.Wait() == 0);
  const Calibration calibration = torquer::calibration::ReadCalibration(folder.Path("mouse.toml"));
  CHECK(calibration.device == "046d:c077");
  const auto found = torquer::calibration::ParametersOf(calibration.motion);
  CHECK(found.gain_mm_per_count == Approx(25.4 / 1600).epsilon(0.001));
  CHECK(found.misalignment_rad * 57.29577951 == Approx(1.0).margin(0.05));
  CHECK(found.cylinder_radius_mm == Approx(5.0).epsilon(0.001));
  CHECK_THAT(program.Output(), !Contains("Joystick"));
}
