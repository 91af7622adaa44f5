#include "host/tools/live_status.h"

#include <catch2/catch.hpp>
#include <limits>

#include "protocol/lcm_channels.h"

using namespace torquer;

namespace {

constexpr std::int64_t kNowUs = 9'000'000;
constexpr bus::Sender kSender{0x7f000001, 4000};

torquer_lcm::wire_state_t State(std::int64_t command_sequence, double latency_ms) {
  torquer_lcm::wire_state_t state{};
  state.clock_id = 7;
  state.instruments.resize(1);
  state.instrument_count = 1;
  torquer_lcm::instrument_state_t& wire = state.instruments[0];
  wire.name = "guidewire";
  wire.command_sequence = command_sequence;
  wire.origin_us = 1000;
  state.publish_us = 1000 + static_cast<std::int64_t>(1000 * latency_ms);
  wire.insertion_mm = 451.25;
  wire.rotation_rad = 1.5707963;
  state.residual = 2e-6;
  state.max_penetration_um = latency_ms;
  return state;
}

}  // namespace

TEST_CASE("The line has place, status, device, rates, latency, residual and penetration") {
  tools::LiveStatus status(7);
  torquer_lcm::scene_description_t scene{};
  scene.name = "arch";
  status.Add(scene, kSender);
  for (int i = 0; i < 500; ++i) status.Add(torquer_lcm::device_sample_t{});
  status.Add(State(0, 1), kSender, kNowUs);
  status.Add(State(1, 2), kSender, kNowUs);
  status.Add(State(2, 9), kSender, kNowUs);
  status.Add(State(2, 50), kSender, kNowUs);  // contains no new command
  torquer_lcm::health_t health{};
  health.process = "daemon";
  health.state = "running";
  health.message = "reading";
  health.names = {"reports_received", "reports_lost"};
  health.values = {500, 4};
  CHECK(status.Add(health, kNowUs) == "daemon: running: reading");
  health.message = "";
  CHECK(status.Add(health, kNowUs).empty());

  CHECK(status.Line(0.5, kNowUs) ==
        "arch | guidewire 451.25 mm, +90 deg | ok | device running | 1000 reports/s, 4 lost | "
        "8 states/s, latency 2.00 ms (worst 9.00) | residual 2.0e-06, wall 50.0 um");
  CHECK_THAT(status.Line(0.5, kNowUs), Catch::Contains("0 reports/s") &&
                                           Catch::Contains("latency -") &&
                                           Catch::Contains("wall 50.0 um"));
}

TEST_CASE("Latency by another machine's clock is left out") {
  tools::LiveStatus status(8);
  status.Add(State(0, 1), kSender, kNowUs);
  CHECK_THAT(status.Line(1, kNowUs), Catch::Contains("latency -"));
}

TEST_CASE("Events of the wall force are reported once, and the line has the force") {
  tools::LiveStatus status(7);
  status.Add(State(0, 1), kSender, kNowUs);
  torquer_lcm::readings_t readings{};
  const double unknown = std::numeric_limits<double>::quiet_NaN();
  readings.names = {"wall_force_largest_mN", "wall_force_sum_mN",
                    "wall_force_events",     "wall_force_largest_ever_mN",
                    "wall_force_event_s",    "wall_force_event_mN",
                    "target_reached",        "target_reached_s"};
  readings.values = {0.5, 1.25, 2, 3.5, 4, 3.5, 0, unknown};
  // Two events from before the first readings are not news.
  CHECK(status.Add(readings).empty());
  CHECK_THAT(status.Line(1, kNowUs),
             Catch::Contains("| ok | force 0.5 mN, sum 1.25, most 3.5, 2 events | device"));
  readings.values = {5, 6, 3, 5, 7.25, 5, 0, unknown};
  CHECK(status.Add(readings) == "wall force: event 3: above the threshold at 7.25 s, 5 mN so far");
  CHECK(status.Add(readings).empty());
  readings.values[6] = 1;
  readings.values[7] = 9.5;
  CHECK(status.Add(readings) == "assessment: target reached at 9.50 s");
  // Until a tick has converged, nothing is known; the first event after it is news.
  readings.values = {5, 6, unknown, unknown, unknown, unknown, unknown, unknown};
  CHECK(status.Add(readings).empty());
  CHECK_THAT(status.Line(1, kNowUs), Catch::Contains("force 5 mN, sum 6, most -, - events"));
  readings.values = {5, 6, 1, 5, 8.5, 5, 0, unknown};
  CHECK(status.Add(readings) == "wall force: event 1: above the threshold at 8.50 s, 5 mN so far");
  // A restarted scene has no events.
  readings.values = {0, 0, 0, 0, unknown, unknown, 0, unknown};
  CHECK(status.Add(readings).empty());
}

TEST_CASE("An instrument that leaves the model is reported, and the line shows it") {
  tools::LiveStatus status(7);
  torquer_lcm::readings_t readings{};
  readings.names = {"left_model_mm", "left_model_events", "left_model_event_s"};
  readings.values = {0, 0, std::numeric_limits<double>::quiet_NaN()};
  CHECK(status.Add(readings).empty());
  readings.values = {3, 1, 4.25};
  CHECK(status.Add(readings) == "outlets: an instrument left the model at 4.25 s");
  CHECK(status.Add(readings).empty());
  CHECK(tools::StatusWords(protocol::kWireConverged | protocol::kWireLeftModel) ==
        "left the model");
}

TEST_CASE("A silent bus is reported") {
  tools::LiveStatus status(7);
  CHECK(status.Line(1, kNowUs) ==
        "no scene | no wire yet | device no daemon | 0 reports/s, - lost | 0 states/s, latency -");
}

TEST_CASE("The line has every instrument with its latency") {
  tools::LiveStatus status(7);
  torquer_lcm::wire_state_t state = State(0, 3);
  torquer_lcm::instrument_state_t catheter = state.instruments[0];
  catheter.name = "catheter";
  catheter.command_sequence = 4;
  catheter.origin_us -= 4000;
  catheter.insertion_mm = 380;
  catheter.rotation_rad = -0.5235988;
  state.instruments.push_back(catheter);
  state.instrument_count = 2;
  status.Add(state, kSender, kNowUs);
  // In this state only the catheter's command is new.
  state.instruments[1].command_sequence = 5;
  status.Add(state, kSender, kNowUs);
  const std::string line = status.Line(1, kNowUs);
  CHECK_THAT(line,
             Catch::Contains("| guidewire 451.25 mm, +90 deg | catheter 380.00 mm, -30 deg | ok"));
  // From latencies of 3, 7 and 7 ms.
  CHECK_THAT(line, Catch::Contains("latency 7.00 ms (worst 7.00)"));
}

TEST_CASE("Status in words") {
  CHECK(tools::StatusWords(protocol::kWireConverged) == "ok");
  CHECK(tools::StatusWords(protocol::kWireBudgetSpent | protocol::kWireSnapped) ==
        "out of time, snapped");
}

TEST_CASE("The line has every daemon, and messages name their daemon") {
  tools::LiveStatus status(7);
  torquer_lcm::health_t health{};
  health.process = "daemon";
  health.state = "running";
  health.message = "reading";
  health.names = {"reports_lost"};
  health.values = {4};
  health.instrument = "guidewire";
  CHECK(status.Add(health, kNowUs) == "daemon of guidewire: running: reading");
  CHECK_THAT(status.Line(1, kNowUs), Catch::Contains("| device running | 0 reports/s, 4 lost"));
  health.instrument = "catheter";
  health.state = "waiting for device";
  health.values = {3};
  status.Add(health, kNowUs);
  CHECK_THAT(status.Line(1, kNowUs),
             Catch::Contains("| devices catheter waiting for device, guidewire "
                             "running | 0 reports/s, 7 lost"));
  // A daemon that has just started has no counts.
  torquer_lcm::health_t started{};
  started.process = "daemon";
  started.instrument = "sheath";
  started.state = "running";
  status.Add(started, kNowUs);
  CHECK_THAT(status.Line(1, kNowUs), Catch::Contains("reports/s, at least 7 lost"));
  health.process = "emulator";
  health.instrument = "";
  health.device = "BOX-2";
  CHECK(status.Add(health, kNowUs) == "emulator of BOX-2: waiting for device: reading");
}

TEST_CASE("Values that no longer arrive are shown as old, not as current") {
  tools::LiveStatus status(7);
  torquer_lcm::wire_state_t state = State(0, 1);
  state.status = protocol::kWireConverged;
  status.Add(state, kSender, kNowUs);
  torquer_lcm::health_t health{};
  health.process = "daemon";
  health.instrument = "guidewire";
  health.state = "running";
  status.Add(health, kNowUs);
  // A wire at rest is published every 0.2 s, health every second: neither is overdue yet.
  CHECK_THAT(status.Line(1, kNowUs + 900'000), Catch::Contains("| ok | device running |"));
  const std::string later = status.Line(1, kNowUs + 5'000'000);
  CHECK_THAT(later, Catch::Contains("| guidewire 451.25 mm, +90 deg | simulator silent for 5 s, "
                                    "showing its last values | device silent for 5 s |"));
  CHECK_THAT(later, !Catch::Contains("ok") && !Catch::Contains("running"));
  // One daemon is back, the second one is not.
  status.Add(health, kNowUs + 5'000'000);
  health.instrument = "catheter";
  status.Add(health, kNowUs);
  CHECK_THAT(status.Line(1, kNowUs + 5'000'000),
             Catch::Contains("| devices catheter silent for 5 s, guidewire running |"));
  status.Add(state, kSender, kNowUs + 5'000'000);
  CHECK_THAT(status.Line(1, kNowUs + 5'000'000), Catch::Contains("| ok |"));
}

TEST_CASE("Text and numbers of other programs are harmless") {
  tools::LiveStatus status(7);
  torquer_lcm::scene_description_t scene{};
  scene.name = "arch\x1b[2J";
  status.Add(scene, kSender);
  torquer_lcm::wire_state_t state = State(0, 1);
  state.instruments[0].name = "wire\r\n| ok";
  state.instruments[0].origin_us = INT64_MIN;
  state.publish_us = INT64_MAX;
  state.instruments.resize(1000, state.instruments[0]);
  status.Add(state, kSender, kNowUs);
  torquer_lcm::health_t health{};
  health.process = "daemon\x07";
  health.device = "\xff";
  health.state =
      "\x9b"
      "2J";
  health.message = std::string(60'000, '\n');
  const std::string news = status.Add(health, kNowUs);
  CHECK_THAT(news, Catch::StartsWith("daemon\\x07 of \\xff: \\x9b2J: \\x0a"));
  CHECK(news.size() < 1000);
  health.process = "daemon";
  health.names = {"reports_lost"};
  health.values = {INT64_MAX};
  for (int k = 0; k < 1000; ++k) {
    health.instrument = "wire " + std::to_string(k);
    status.Add(health, kNowUs + k);
  }
  const std::string line = status.Line(1, kNowUs + 1000);
  CHECK_THAT(line, Catch::StartsWith("arch\\x1b[2J | wire\\x0d\\x0a| ok 451.25 mm"));
  CHECK_THAT(line, Catch::Contains("wire 999 \\x9b2J"));
  CHECK_THAT(line, Catch::Contains("latency -"));
  CHECK(line.size() < 3000);
  for (const char byte : line + news) {
    REQUIRE(static_cast<unsigned char>(byte) >= 0x20);
    REQUIRE(static_cast<unsigned char>(byte) < 0x7f);
  }
}

TEST_CASE("The line shows two simulators on one bus with their scenes, while both publish") {
  tools::LiveStatus status(7);
  constexpr bus::Sender kOther{0x7f000001, 4001};
  torquer_lcm::scene_description_t scene{};
  status.Add(State(0, 1), kSender, kNowUs);
  scene.name = "arch";
  status.Add(scene, kSender);
  CHECK_THAT(status.Line(1, kNowUs), Catch::StartsWith("arch | "));
  status.Add(State(0, 1), kOther, kNowUs);
  scene.name = "tube\n";
  status.Add(scene, kOther);
  CHECK_THAT(status.Line(1, kNowUs),
             Catch::StartsWith("2 simulators publish: arch from 127.0.0.1:4000 and tube\\x0a from "
                               "127.0.0.1:4001; stop all but one | "));
  status.Add(State(0, 1), kOther, kNowUs + 2'000'000);
  CHECK_THAT(status.Line(1, kNowUs + 2'000'000), Catch::StartsWith("tube\\x0a | "));
  // Invented senders.
  for (std::uint16_t port = 0; port < 1000; ++port) {
    status.Add(State(0, 1), {0x7f000001, port}, kNowUs + 2'000'000);
  }
  const std::string line = status.Line(1, kNowUs + 2'000'000);
  CHECK_THAT(line, Catch::StartsWith("4 simulators publish: "));
  CHECK(line.size() < 600);
}

TEST_CASE(
    "A daemon whose instrument the scene does not have is named so, and crowds out no other") {
  tools::LiveStatus status(7);
  torquer_lcm::health_t health{};
  health.process = "daemon";
  health.state = "running";
  health.instrument = "cathteter";
  status.Add(health, kNowUs);
  CHECK_THAT(status.Line(1, kNowUs), Catch::Contains("| device running |"));
  status.Add(State(0, 1), kSender, kNowUs);
  CHECK_THAT(status.Line(1, kNowUs),
             Catch::Contains("| device cathteter running, an instrument that the scene does not "
                             "have |"));
  health.instrument = "guidewire";
  status.Add(health, kNowUs);
  CHECK_THAT(status.Line(1, kNowUs),
             Catch::Contains("| devices cathteter running, an instrument that the scene does not "
                             "have, guidewire running |"));
  for (int k = 0; k < 100; ++k) {
    health.instrument = "made-up " + std::to_string(k);
    status.Add(health, kNowUs + k);
  }
  CHECK_THAT(status.Line(1, kNowUs + 100), Catch::Contains("guidewire running"));
}

TEST_CASE("A narrow terminal shows whole parts of the line") {
  const std::string line = "arch | guidewire 451.25 mm, +90 deg | ok | device running";
  CHECK(tools::FittingParts(line, line.size()) == line);
  CHECK(tools::FittingParts(line, line.size() - 1) == "arch | guidewire 451.25 mm, +90 deg | ok");
  CHECK(tools::FittingParts(line, 40) == "arch | guidewire 451.25 mm, +90 deg | ok");
  CHECK(tools::FittingParts(line, 39) == "arch | guidewire 451.25 mm, +90 deg");
  CHECK(tools::FittingParts(line, 20) == "arch");
  CHECK(tools::FittingParts(line, 4) == "arch");
  CHECK(tools::FittingParts(line, 3) == "...");
  CHECK(tools::FittingParts(line, 2) == "ar");
  CHECK(tools::FittingParts(line, 0).empty());
  CHECK(tools::FittingParts("left_coronary", 8) == "left_...");
}
