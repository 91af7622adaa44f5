// Live emulator on LCM: motion as input, truth and health as output.
#include <atomic>
#include <catch2/catch.hpp>
#include <chrono>
#include <cmath>
#include <limits>
#include <string>
#include <thread>

#include "host/bus/bus.h"
#include "host/bus/clock.h"
#include "host/emulator/emulator_run.h"
#include "protocol/hid_reports.h"
#include "protocol/lcm_channels.h"
#include "tests/support/paths.h"
#include "tests/support/private_network.h"
#include "tests/support/temporary_folder.h"
#include "torquer_lcm/hand_motion_t.hpp"
#include "torquer_lcm/health_t.hpp"

namespace torquer::emulator {
namespace {

using torquer_lcm::hand_motion_t;
using torquer_lcm::health_t;

TEST_CASE("the hand follows LCM, and the truth about it and the sensor comes back") {
  test::NeedPrivateNetwork();
  const test::TemporaryFolder folder;
  RunOptions options;
  options.firmware = torquer::test::FirmwarePath("torquer-firmware.elf");
  options.socket = folder.Path("socket");
  options.bench.serial = "LIVE-1";
  EmulatorRun run(options);
  std::atomic<bool> stop = false;
  std::thread thread([&] { run.Run(stop); });

  bus::Bus bus;
  hand_motion_t truth{};
  health_t health{};
  int truths = 0;
  bool refused = false;
  bus.Subscribe<hand_motion_t>(protocol::kEmulatorTruthChannel, [&](const hand_motion_t& message) {
    truth = message;
    ++truths;
  });
  bus.Subscribe<health_t>(protocol::kHealthChannel, [&](const health_t& message) {
    health = message;
    for (int i = 0; i < message.count; ++i) {
      const auto at = static_cast<std::size_t>(i);
      refused = refused || (message.names[at] == "messages_refused" && message.values[at] > 0);
    }
  });
  hand_motion_t hand{};
  hand.joystick_x = 0.5;
  hand.buttons = protocol::kButtonClutch;
  const auto deadline = std::chrono::steady_clock::now() + std::chrono::seconds(120);
  const auto wait_until = [&](auto reached) {
    while (!reached() && std::chrono::steady_clock::now() < deadline) {
      bus.Publish(protocol::kHandMotionChannel, hand);
      while (bus.Handle(5) > 0) {
      }
    }
    return reached();
  };
  // The sensor starts within 0.2 s of device time, and counts only after that.
  CHECK(wait_until([&] { return truth.time_s > 0.3; }));
  const std::int64_t counts = truth.axial_counts;
  hand.insertion_mm = 25.4;
  hand.rotation_rad = 1;
  CHECK(wait_until([&] { return truth.axial_counts == counts + 1200; }));
  CHECK(truth.insertion_mm == Approx(25.4));
  CHECK(truth.rotation_rad == Approx(1));
  CHECK(truth.transverse_counts == 236);
  CHECK(truth.joystick_x == Approx(0.5));
  CHECK(truth.buttons == protocol::kButtonClutch);
  CHECK(truth.clock_id == bus::ClockId());
  CHECK(truths > 10);
  CHECK(health.process == "emulator");
  CHECK(health.device == "LIVE-1");
  CHECK(health.state == "waiting for client");

  hand.insertion_mm = std::numeric_limits<double>::quiet_NaN();
  CHECK(wait_until([&] { return refused; }));
  CHECK(truth.axial_counts == counts + 1200);
  stop = true;
  thread.join();
}

TEST_CASE("live motion moves the box that it names, or every box") {
  test::NeedPrivateNetwork();
  bus::Bus sender;
  LiveBus first("");
  LiveBus second("");
  first.SetSerial("BOX-1");
  second.SetSerial("BOX-2");
  LiveHand first_hand;
  LiveHand second_hand;
  double time_s = 0;
  // Motion for another box is sent first: it has arrived once the last message has.
  const auto move = [&](const std::string& device, double insertion_mm) {
    hand_motion_t hand{};
    hand.device = "BOX-3";
    hand.insertion_mm = 99;
    sender.Publish(protocol::kHandMotionChannel, hand);
    hand.device = device;
    hand.insertion_mm = insertion_mm;
    sender.Publish(protocol::kHandMotionChannel, hand);
    for (int i = 0; i < 20; ++i) {
      std::this_thread::sleep_for(std::chrono::milliseconds(10));
      time_s += 1;
      first.Service(time_s, &first_hand);
      second.Service(time_s, &second_hand);
    }
  };
  const auto at = [&](const LiveHand& hand) { return hand.At(time_s + 1).insertion_mm; };
  move("BOX-2", 5);
  CHECK(at(first_hand) == 0);
  CHECK(at(second_hand) == 5);
  move("BOX-1", 7);
  CHECK(at(first_hand) == 7);
  CHECK(at(second_hand) == 5);
  move("", 9);
  CHECK(at(first_hand) == 9);
  CHECK(at(second_hand) == 9);
}

TEST_CASE("a motion of the catheter changes the second sensor's hand alone") {
  test::NeedPrivateNetwork();
  bus::Bus sender;
  LiveBus box("");
  box.SetSerial("BOX-1");
  LiveHand hand;
  double time_s = 0;
  const auto send = [&](const std::string& device, double insertion_mm, double joystick_x,
                        int buttons, auto reached) {
    hand_motion_t motion{};
    motion.device = device;
    motion.insertion_mm = insertion_mm;
    motion.rotation_rad = insertion_mm / 10;
    motion.joystick_x = joystick_x;
    motion.buttons = static_cast<std::int8_t>(buttons);
    sender.Publish(protocol::kHandMotionChannel, motion);
    for (int i = 0; i < 6000 && !reached(hand.target()); ++i) {
      std::this_thread::sleep_for(std::chrono::milliseconds(10));
      box.Service(time_s += 1, &hand);
    }
    return hand.target();
  };
  send("BOX-1", 5, 0.5, protocol::kButtonXray,
       [](const HandState& at) { return at.insertion_mm == 5; });
  const HandState at = send("BOX-1.2", 7, 0, 0, [](const HandState& target) {
    return target.catheter_insertion_mm == 7;
  });
  CHECK(at.catheter_insertion_mm == 7);
  CHECK(at.catheter_rotation_rad == Approx(0.7));
  CHECK(at.insertion_mm == 5);
  CHECK(at.rotation_rad == Approx(0.5));
  CHECK(at.joystick_x == 0.5);
  CHECK(at.buttons == protocol::kButtonXray);
}

TEST_CASE("a live hand glides to each new place in the time between messages") {
  LiveHand hand;
  hand.Set(1.00, {10, 0, 0, 0, 0});
  hand.Set(1.02, {20, 2, 1, 0, 1});
  CHECK(hand.At(1.02).insertion_mm == Approx(10 * 0.02 / 0.05));
  CHECK(hand.At(1.02).buttons == 1);
  CHECK(hand.At(1.04).insertion_mm == Approx(20));
  CHECK(hand.At(1.04).rotation_rad == Approx(2));
  CHECK(hand.At(9).insertion_mm == Approx(20));
}

}  // namespace
}  // namespace torquer::emulator
