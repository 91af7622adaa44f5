// Recovery by the daemon: a lost firmware image of the sensor, and motion that the sensor missed.
#include <catch2/catch.hpp>
#include <chrono>
#include <cmath>
#include <filesystem>
#include <fstream>
#include <thread>

#include "tests/daemon/daemon_chain.h"

namespace {

using torquer::protocol::InputReport;
using torquer::test::Chain;
using torquer::test::ChildProcess;
using torquer::test::Contains;
using torquer::test::kMmPerCount;
using torquer::test::Listener;
using torquer::test::Next;
using torquer::test::SocketDevice;
using torquer::test::SocketWords;
using torquer::test::StillReport;

}  // namespace

TEST_CASE("A kept firmware image of the sensor is loaded again after a loss") {
  Listener listener;
  std::filesystem::create_directories(listener.folder.Path("torquer"));
  const std::string kept = listener.folder.Path("torquer/SCRIPTED-1.srom");
  const auto keep = [&](std::size_t bytes) {
    std::ofstream(kept, std::ios::binary) << std::string(bytes, '\x81');
  };
  const std::string socket = listener.folder.Path("device");
  SocketDevice device(socket);
  InputReport still = StillReport();
  const auto report = [&](std::uint8_t flags) {
    still = Next(still);
    still.flags = flags;
    device.Send(still);
  };
  const auto says = [&](const std::string& text) { return listener.UntilHealth("running", text); };
  constexpr std::uint8_t kLost = torquer::protocol::kFlagSromLost;

  SECTION("at the start, and after a loss while the sensor works again") {
    keep(torquer::protocol::kSromBytes);
    const ChildProcess daemon(SocketWords(socket));
    REQUIRE(device.WaitForHost());
    report(0);
    REQUIRE(says("the sensor runs firmware image 5 again, from " + kept));
    listener.Forget();
    device.srom_id = 0;
    report(kLost | torquer::protocol::kFlagSensorFault);
    REQUIRE(listener.UntilHealth("sensor fault", ""));
    CHECK(device.srom_id == 0);
    report(kLost);
    REQUIRE(listener.Until([&] { return listener.counters["sensor_images_loaded"] == 2; }));
    CHECK(device.srom_id == 5);
    // A restarted device has no memory of a loaded image.
    device.srom_id = 0;
    ++still.boot_id;
    report(0);
    REQUIRE(listener.Until([&] { return listener.counters["sensor_images_loaded"] == 3; }));
  }
  SECTION("missing: said once, with the remedy") {
    const ChildProcess daemon(SocketWords(socket));
    REQUIRE(device.WaitForHost());
    report(kLost);
    REQUIRE(says("because " + kept +
                 " does not exist; load the image again with torquer-flash --srom"));
    CHECK(listener.counters["sensor_images_loaded"] == 0);
  }
  SECTION("no image was ever loaded: no message") {
    const ChildProcess daemon(SocketWords(socket));
    REQUIRE(device.WaitForHost());
    report(0);
    device.Unplug();
    REQUIRE(listener.UntilHealth("waiting for device", ""));
    CHECK_FALSE(Contains(daemon.Error(), "firmware image"));
  }
  SECTION("damaged, and refused by the sensor: said with the reason, and not tried for ever") {
    keep(100);
    const ChildProcess daemon(SocketWords(socket));
    REQUIRE(device.WaitForHost());
    report(0);
    REQUIRE(says("SCRIPTED-1.srom: has 100 bytes"));
    keep(torquer::protocol::kSromBytes);
    device.stalls_srom = true;
    device.Unplug();
    REQUIRE(device.WaitForHost());
    for (int i = 0; i < 20; ++i) report(kLost);
    REQUIRE(says("the sensor rejected the firmware image"));
    REQUIRE(listener.UntilCommands(21));
    // The daemon tries again every 50 ms, at most three times in all.
    for (int i = 0; i < 10; ++i) {
      std::this_thread::sleep_for(std::chrono::milliseconds(50));
      report(kLost);
    }
    REQUIRE(listener.UntilCommands(31));
    device.Unplug();
    REQUIRE(listener.UntilHealth("waiting for device", ""));
    const std::string said = daemon.Error();
    const std::size_t first = said.find("the sensor rejected");
    CHECK(said.find("the sensor rejected", first + 1) == std::string::npos);
  }
}

TEST_CASE("Motion lost before the end switch closes again is corrected and reported") {
  Chain chain;
  REQUIRE(chain.device.WaitForHost());
  const auto close_switch = [&] {
    chain.report.flags = torquer::protocol::kFlagReference | torquer::protocol::kFlagAtReference;
    chain.report.reference_counts = chain.report.axial_counts;
    chain.Push(0);
    chain.report.flags = torquer::protocol::kFlagReference;
  };
  chain.Push(1000);
  close_switch();
  REQUIRE(chain.listener.UntilHealth("running", "the end switch closed; from now on"));
  chain.Push(2000);
  // The sensor reports only 600 of 2000 counts on the way back: 29.63 mm are missing.
  const double before_mm = chain.Push(-600).insertion_mm;
  close_switch();
  REQUIRE(chain.listener.UntilHealth(
      "running", "the end switch shows that 29.6 mm of pulling back were lost"));
  double last_mm = chain.Push(0).insertion_mm;
  double largest_mm = 0;
  for (int i = 0; i < 160; ++i) {
    const double now_mm = chain.Push(0).insertion_mm;
    largest_mm = std::max(largest_mm, std::abs(now_mm - last_mm));
    last_mm = now_mm;
  }
  CHECK(last_mm == Approx(before_mm - 1400 * kMmPerCount));
  CHECK(largest_mm < 0.21);  // in 10 ms, at 20 mm/s
  REQUIRE(chain.listener.Until([&] { return chain.listener.counters["healed_um"] == -29633; }));
  CHECK(chain.listener.counters["marks_passed"] == 2);
}
