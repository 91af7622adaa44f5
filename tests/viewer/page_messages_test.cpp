#include "host/viewer/page_messages.h"

#include <algorithm>
#include <catch2/catch.hpp>
#include <cmath>
#include <cstring>
#include <limits>
#include <map>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

using namespace torquer::viewer;

namespace {

template <class Value>
Value At(const std::string& frame, std::size_t offset) {
  REQUIRE(offset + sizeof(Value) <= frame.size());
  Value value;
  std::memcpy(&value, frame.data() + offset, sizeof value);
  return value;
}

torquer_lcm::wire_state_t ThreeNodes() {
  torquer_lcm::wire_state_t state{};
  state.tick = 7;
  state.clock_id = 5;
  state.publish_us = 9000;
  state.status = 33;
  state.stride = 2;
  state.instrument_count = 1;
  state.instruments.resize(1);
  state.instruments[0].insertion_mm = 12.5;
  state.instruments[0].command_sequence = 3;
  state.instruments[0].origin_us = 4000;
  state.instruments[0].tip_mm[2] = 6;
  state.instruments[0].node_count = 2;
  state.instruments[0].nodes_mm = {{8, 9, 10}, {11, 12, 13}};
  state.node_count = 3;
  state.nodes_mm = {{1, 2, 3}, {4, 5, 6}, {7, 8, 9}};
  state.contact_count = 2;
  state.contact_nodes = {2, 3};
  state.contact_penetrations_um = {20, 30};
  return state;
}

std::vector<std::uint8_t> Bytes(std::uint8_t flags, float push, float turn, float lao, float cra) {
  std::vector<std::uint8_t> bytes = {16, 1, flags, 0};
  for (const float rate : {push, turn, lao, cra}) {
    const auto* first = reinterpret_cast<const std::uint8_t*>(&rate);
    bytes.insert(bytes.end(), first, first + sizeof rate);
  }
  return bytes;
}

}  // namespace

// Offsets documented in host/viewer/README.md.
TEST_CASE("A state's frame has the documented layout") {
  const torquer_lcm::wire_state_t state = ThreeNodes();
  const std::string frame = StateFrame(state, nullptr, 5);
  REQUIRE(frame.size() == 64 + 64 + 3 * 12 + 3 * 4 + 3 * 4 + 4 + 2 * 12);
  CHECK(frame[0] == 1);
  CHECK(frame[1] == 1);
  CHECK(At<std::uint16_t>(frame, 2) == 1);
  CHECK(At<std::uint32_t>(frame, 4) == 3);
  CHECK(At<double>(frame, 16) == 7);
  CHECK(At<std::uint32_t>(frame, 56) == 33);
  CHECK(At<double>(frame, 64) == 12.5);
  CHECK(At<double>(frame, 64 + 32) == 5.0);  // ms from the hand to the state
  CHECK(At<double>(frame, 64 + 56) == 6.0);
  CHECK(At<float>(frame, 128 + 12) == 4.0F);
  CHECK(std::isnan(At<float>(frame, 128 + 36)));
  // Contacts refer to nodes of the whole curve; the frame contains every second node.
  CHECK(At<float>(frame, 128 + 48) == 0.0F);
  CHECK(At<float>(frame, 128 + 48 + 4) == 30.0F);
  // The instrument's own nodes.
  CHECK(At<std::uint32_t>(frame, 128 + 60) == 2);
  CHECK(At<float>(frame, 128 + 64 + 20) == 13.0F);
  // With a foreign clock, a latency would be meaningless.
  CHECK(std::isnan(At<double>(StateFrame(state, nullptr, 6), 64 + 32)));
}

TEST_CASE("Contact forces are shown with the state of their tick alone") {
  torquer_lcm::wire_state_t state = ThreeNodes();
  state.instruments[0].nodes_mm.clear();
  torquer_lcm::wire_forces_t forces{};
  forces.tick = 7;
  forces.stride = 2;
  forces.node_count = 3;
  forces.contact_force_mN = {{0, 0, 0}, {3, 4, 0}, {0, 0, 2}};
  CHECK(At<float>(StateFrame(state, &forces, 5), 128 + 36 + 4) == 5.0F);
  forces.tick = 6;
  CHECK(std::isnan(At<float>(StateFrame(state, &forces, 5), 128 + 36 + 4)));
}

TEST_CASE("Contact forces of an instrument that reaches farther are not shown on the innermost") {
  torquer_lcm::wire_state_t state = ThreeNodes();
  state.instrument_count = 2;
  state.instruments = {state.instruments[0], state.instruments[0]};
  state.instruments[0].nodes_mm.clear();
  torquer_lcm::wire_forces_t forces{};
  forces.tick = 7;
  forces.stride = 2;
  forces.node_count = 3;
  forces.contact_force_mN = {{0, 0, 0}, {3, 4, 0}, {0, 0, 2}};
  const auto shown_mN = [&] {
    return At<float>(StateFrame(state, &forces, 5), 64 + 2 * 64 + 36 + 4);
  };
  CHECK(shown_mN() == 5.0F);
  state.instruments[1].insertion_mm += 0.3;
  CHECK(std::isnan(shown_mN()));
}

TEST_CASE("A contact beyond the nodes that are there is left out") {
  torquer_lcm::wire_state_t state = ThreeNodes();
  state.contact_nodes = {-4, 2000};
  CHECK(StateFrame(state, nullptr, 5).size() == 188 + 4 + 2 * 12);
}

TEST_CASE("A reading that is not known is null on the page") {
  torquer_lcm::readings_t readings{};
  readings.names = {"wall_force_largest_mN", "safe_success"};
  readings.values = {20, std::numeric_limits<double>::quiet_NaN()};
  readings.count = 2;
  const nlohmann::json values = nlohmann::json::parse(ReadingsText(readings)).at("values");
  CHECK(values.at("wall_force_largest_mN") == 20);
  CHECK(values.at("safe_success").is_null());
}

TEST_CASE("The page gets the patient's curves, with null for what is not known") {
  constexpr double kUnknown = std::numeric_limits<double>::quiet_NaN();
  torquer_lcm::vital_signs_t vitals{};
  vitals.heart_rate_per_min = 72;
  vitals.systolic_mmHg = kUnknown;
  vitals.wedged = 1;
  vitals.alarms = 18;
  vitals.rate_limits_per_min[1] = 60;
  vitals.sample_s = 0.004;
  vitals.first_sample = 40;
  vitals.ecg = {0.12345F, 1};
  vitals.pressure_mmHg = {static_cast<float>(kUnknown), 119.98765F};
  vitals.sample_count = 2;
  const nlohmann::json text = nlohmann::json::parse(PatientText(vitals));
  CHECK(text.at("kind") == "patient");
  CHECK(text.at("heart_rate_per_min") == 72);
  CHECK(text.at("systolic_mmHg").is_null());
  CHECK(text.at("wedged") == true);
  CHECK(text.at("alarms") == 18);
  CHECK(text.at("rate_limits_per_min") == nlohmann::json({0, 60}));
  CHECK(text.at("first_sample") == 40);
  CHECK(text.at("ecg") == nlohmann::json({0.123, 1}));
  CHECK(text.at("pressure_mmHg").at(0).is_null());
  CHECK(text.at("pressure_mmHg").at(1) == 119.988);
  // Any program may send more samples than a page shows: the newest stay.
  vitals.ecg.assign(3000, 0.5F);
  vitals.ecg.back() = 1;
  vitals.pressure_mmHg.assign(3000, 80);
  vitals.sample_count = 3000;
  const nlohmann::json long_text = nlohmann::json::parse(PatientText(vitals));
  CHECK(long_text.at("ecg").size() == kMostVitalSamples);
  CHECK(long_text.at("ecg").back() == 1);
  CHECK(long_text.at("first_sample") == 40 + 3000 - static_cast<int>(kMostVitalSamples));
}

TEST_CASE("Controls are taken only as the page sends them") {
  const float nan = std::numeric_limits<float>::quiet_NaN();
  const auto controls = ReadControls(Bytes(3, 40, -3, 0.5F, 0));
  CHECK(ReadControls(Bytes(4, 0, 0, 0, 0))->acquisition);
  REQUIRE(controls);
  CHECK(controls->xray);
  CHECK(controls->contrast);
  CHECK(controls->push_mm_s == 40);
  CHECK(controls->turn_rad_s == -3);
  CHECK(controls->lao_rad_s == 0.5);
  CHECK_FALSE(controls->acquisition);
  CHECK_FALSE(ReadControls(Bytes(8, 0, 0, 0, 0)));
  CHECK_FALSE(ReadControls(Bytes(0, 201, 0, 0, 0)));
  CHECK_FALSE(ReadControls(Bytes(0, 0, -21, 0, 0)));
  CHECK_FALSE(ReadControls(Bytes(0, 0, 0, nan, 0)));
  CHECK_FALSE(ReadControls(Bytes(0, 0, 0, 0, std::numeric_limits<float>::infinity())));
  std::vector<std::uint8_t> bytes = Bytes(0, 0, 0, 0, 0);
  REQUIRE(ReadControls(bytes));
  for (std::size_t size = 0; size < bytes.size(); ++size) {
    CHECK_FALSE(ReadControls({bytes.data(), size}));
  }
  bytes.push_back(0);
  CHECK_FALSE(ReadControls(bytes));
  bytes.pop_back();
  bytes[1] = 2;
  CHECK_FALSE(ReadControls(bytes));
}

TEST_CASE("A motion of the table is taken only as the page sends it") {
  auto bytes = Bytes(0, 60, -30, 0.5F, 0);
  CHECK_FALSE(ReadTableMotion(bytes));
  bytes[0] = 20;
  const auto motion = ReadTableMotion(bytes);
  REQUIRE(motion);
  CHECK(motion->left_mm_s == 60);
  CHECK(motion->head_mm_s == -30);
  CHECK(motion->height_mm_s == 0.5);
  CHECK_FALSE(ReadControls(bytes));
  bytes.pop_back();
  CHECK_FALSE(ReadTableMotion(bytes));
  for (const float bad : {101.0F, -101.0F, std::numeric_limits<float>::quiet_NaN()}) {
    bytes = Bytes(0, 0, 0, bad, 0);
    bytes[0] = 20;
    CHECK_FALSE(ReadTableMotion(bytes));
  }
}

TEST_CASE("Controls of a replay are accepted only in the page's format") {
  const auto message = [](std::uint8_t play, float speed, double at_s, std::int32_t steps) {
    std::vector<std::uint8_t> bytes = {17, 1, play, 0};
    const auto add = [&bytes](const auto& value) {
      const auto* first = reinterpret_cast<const std::uint8_t*>(&value);
      bytes.insert(bytes.end(), first, first + sizeof value);
    };
    add(speed);
    add(at_s);
    add(steps);
    return bytes;
  };
  const double nowhere = std::numeric_limits<double>::quiet_NaN();
  const auto taken = ReadReplayControls(message(1, 2.5F, 12.25, -3));
  REQUIRE(taken);
  CHECK(taken->play);
  CHECK(taken->speed == 2.5);
  CHECK(taken->at_s == 12.25);
  CHECK(taken->steps == -3);
  const auto staying = ReadReplayControls(message(0, 0.1F, nowhere, 0));
  REQUIRE(staying);
  CHECK_FALSE(staying->play);
  CHECK_FALSE(staying->at_s);
  const float infinite = std::numeric_limits<float>::infinity();
  CHECK(ReadReplayControls(message(1, 10, 0, 1000)));
  CHECK_FALSE(ReadReplayControls(message(2, 1, 0, 0)));
  CHECK_FALSE(ReadReplayControls(message(1, 0.09F, 0, 0)));
  CHECK_FALSE(ReadReplayControls(message(1, 11, 0, 0)));
  CHECK_FALSE(ReadReplayControls(message(1, infinite, 0, 0)));
  CHECK_FALSE(ReadReplayControls(message(1, std::nanf(""), 0, 0)));
  CHECK_FALSE(ReadReplayControls(message(1, 1, -0.001, 0)));
  CHECK_FALSE(ReadReplayControls(message(1, 1, double{infinite}, 0)));
  CHECK_FALSE(ReadReplayControls(message(1, 1, 0, 1001)));
  CHECK_FALSE(ReadReplayControls(message(1, 1, 0, std::numeric_limits<std::int32_t>::min())));
  auto other = message(1, 1, 0, 0);
  CHECK_FALSE(ReadControls(other));
  other[1] = 2;
  CHECK_FALSE(ReadReplayControls(other));
  other[1] = 1;
  other.push_back(0);
  CHECK_FALSE(ReadReplayControls(other));
}

TEST_CASE("A choice for the X-ray system is taken only as the page sends it") {
  const auto message = [](std::uint8_t mode, float pulses, float magnification, std::uint8_t left,
                          std::uint8_t bottom) {
    std::vector<std::uint8_t> bytes = {18, 1, mode, 2};
    for (const float value : {pulses, magnification}) {
      const auto* first = reinterpret_cast<const std::uint8_t*>(&value);
      bytes.insert(bytes.end(), first, first + sizeof value);
    }
    bytes.insert(bytes.end(), {left, 2, 3, bottom, 4, 3, 2, 1, 50, 7, 0xa6, 90});
    bytes.insert(bytes.end(), {0, 0, 0x40, 0x40});  // 3 as a float
    return bytes;
  };
  const auto taken = ReadImaging(message(4, 7.5F, 1.5F, 10, 45));
  REQUIRE(taken);
  const torquer::effects::Imaging& imaging = taken->imaging;
  CHECK(imaging.mode == torquer::effects::Imaging::Mode::kCine);
  CHECK(imaging.pulses_per_s == 7.5);
  CHECK(imaging.magnification == 1.5);
  CHECK(imaging.left == Approx(0.1));
  CHECK(imaging.right == Approx(0.02));
  CHECK(imaging.top == Approx(0.03));
  CHECK(imaging.bottom == Approx(0.45));
  CHECK(taken->number == 0x01020304);
  CHECK(imaging.wedges[0].share == Approx(0.5));
  CHECK(imaging.wedges[1].share == Approx(0.07));
  CHECK(imaging.wedges[0].rotation_deg == -90);
  CHECK(imaging.wedges[1].rotation_deg == 90);
  CHECK(taken->acquisition.mode == torquer::effects::Imaging::Mode::kSubtraction);
  CHECK(taken->acquisition.pulses_per_s == 3);
  CHECK(ReadImaging(message(0, 0, 1, 0, 0)));
  CHECK_FALSE(ReadImaging(message(5, 0, 1, 0, 0)));
  CHECK_FALSE(ReadImaging(message(0, 0.5F, 1, 0, 0)));
  CHECK_FALSE(ReadImaging(message(0, 0, std::nanf(""), 0, 0)));
  CHECK_FALSE(ReadImaging(message(0, 0, 5, 0, 0)));
  CHECK_FALSE(ReadImaging(message(0, 0, 1, 46, 0)));
  auto far = message(0, 0, 1, 0, 0);
  far[20] = 51;
  CHECK_FALSE(ReadImaging(far));
  auto turned = message(0, 0, 1, 0, 0);
  turned[23] = 91;
  CHECK_FALSE(ReadImaging(turned));
  for (const std::uint8_t mode : {0, 1, 3, 5}) {
    auto no_acquisition = message(0, 0, 1, 0, 0);
    no_acquisition[3] = mode;
    CHECK_FALSE(ReadImaging(no_acquisition));
  }
  // 0, 96 and NaN pulses a second.
  for (const auto& [third, fourth] : {std::pair{0, 0}, {0xc0, 0x42}, {0xc0, 0x7f}}) {
    auto pulses = message(0, 0, 1, 0, 0);
    pulses[26] = static_cast<std::uint8_t>(third);
    pulses[27] = static_cast<std::uint8_t>(fourth);
    CHECK_FALSE(ReadImaging(pulses));
  }
  auto other = message(0, 0, 1, 0, 0);
  CHECK_FALSE(ReadControls(other));
  other.push_back(0);
  CHECK_FALSE(ReadImaging(other));
}

TEST_CASE("An order to the power injector is taken only as the page sends it") {
  const auto message = [](std::uint8_t order, double volume_mL, double rate_mL_s, double delay_s,
                          double rise_s) {
    std::vector<std::uint8_t> bytes = {21, 1, order, 0, 0, 0, 0, 0};
    for (const double value : {volume_mL, rate_mL_s, delay_s, rise_s}) {
      const auto* first = reinterpret_cast<const std::uint8_t*>(&value);
      bytes.insert(bytes.end(), first, first + sizeof value);
    }
    return bytes;
  };
  using torquer::effects::Injector;
  CHECK(ReadInjector(message(2, 150, 0.1, 99.9, 9.9)) ==
        Injector{Injector::Order::kInject, 150, 0.1, 99.9, 9.9});
  CHECK(ReadInjector(message(0, -1, -1, -1, -1)) == Injector{});
  CHECK_FALSE(ReadInjector(message(3, 10, 1, 0, 0)));
  CHECK_FALSE(ReadInjector(message(1, 150.1, 1, 0, 0)));
  CHECK_FALSE(ReadInjector(message(1, 10, 0.09, 0, 0)));
  CHECK_FALSE(ReadInjector(message(1, 10, 1, -0.5, 0)));
  CHECK_FALSE(ReadInjector(message(1, 10, 1, 0, std::nan(""))));
  auto other = message(1, 10, 1, 0, 0);
  other[1] = 2;
  CHECK_FALSE(ReadInjector(other));
  other[1] = 1;
  CHECK_FALSE(ReadImaging(other));
  other.push_back(0);
  CHECK_FALSE(ReadInjector(other));
}

TEST_CASE("Orders to exchange are accepted only in the page's format") {
  const auto message = [](std::uint8_t length, const std::string& name) {
    std::vector<std::uint8_t> bytes(kExchangeBytes);
    bytes[0] = 22;
    bytes[1] = 1;
    bytes[2] = 3;
    bytes[3] = length;
    std::copy(name.begin(), name.end(), bytes.begin() + 4);
    return bytes;
  };
  const auto taken = ReadExchange(message(4, "sion"));
  REQUIRE(taken);
  CHECK(taken->instrument == 3);
  CHECK(taken->device == "sion");
  const std::string longest(60, 'd');
  CHECK(ReadExchange(message(60, longest))->device == longest);
  CHECK_FALSE(ReadExchange(message(0, "sion")));
  CHECK_FALSE(ReadExchange(message(61, longest)));
  auto other = message(4, "sion");
  CHECK_FALSE(ReadInjector(other));
  other[1] = 2;
  CHECK_FALSE(ReadExchange(other));
  other[1] = 1;
  other.push_back(0);
  CHECK_FALSE(ReadExchange(other));
}

TEST_CASE("The page gets the devices of the instruments, and those of the library") {
  torquer_lcm::devices_t devices{};
  devices.devices = {"sion", ""};
  devices.exchange_count = 2;
  devices.refusal = "withdraw it";
  CHECK(nlohmann::json::parse(DevicesText(devices)) ==
        nlohmann::json({{"kind", "devices"},
                        {"devices", {"sion", ""}},
                        {"exchanges", 2},
                        {"refusal", "withdraw it"}}));
  const nlohmann::json tray = nlohmann::json::parse(TrayText());
  CHECK(tray["kind"] == "tray");
  std::map<std::string, bool> hollow;
  for (const nlohmann::json& device : tray["devices"]) {
    hollow[device["name"]] = device["hollow"];
    CHECK_FALSE(device["product"].get<std::string>().empty());
  }
  CHECK_FALSE(hollow.at("sion"));
  CHECK(hollow.at("guiding_6f"));
}

TEST_CASE("Choices of cases are accepted only in the page's format") {
  const auto message = [](std::uint8_t action, std::uint8_t number) {
    std::vector<std::uint8_t> bytes(kControlsBytes);
    bytes[0] = 19;
    bytes[1] = 1;
    bytes[2] = action;
    bytes[3] = number;
    return bytes;
  };
  const auto taken = ReadCaseControl(message(1, 63));
  REQUIRE(taken);
  CHECK(taken->action == CaseControl::Action::kStart);
  CHECK(taken->number == 63);
  CHECK(ReadCaseControl(message(2, 0))->action == CaseControl::Action::kEnd);
  CHECK(ReadCaseControl(message(3, 0))->action == CaseControl::Action::kClose);
  CHECK_FALSE(ReadCaseControl(message(0, 0)));
  CHECK(ReadCaseControl(message(4, 7))->action == CaseControl::Action::kExamine);
  CHECK_FALSE(ReadCaseControl(message(5, 0)));
  auto other = message(1, 0);
  CHECK_FALSE(ReadControls(other));
  CHECK_FALSE(ReadImaging(other));
  other[1] = 2;
  CHECK_FALSE(ReadCaseControl(other));
  other[1] = 1;
  other.pop_back();
  CHECK_FALSE(ReadCaseControl(other));
}

TEST_CASE("Centerlines, route and target are given point by point") {
  using torquer::vessel::Centerline;
  const Centerline first("a\nb", {{0, 0, 0}, {10, 0, 0.126}}, {2, 2});
  const Centerline second("c", {{10, 0, 0}, {10, 5, 0}}, {1, 1});
  const torquer::vessel::CenterlineNetwork network({first, second});
  const torquer::effects::AssessmentTask task{second, network, {1, 5}, 4, 120, 2};
  const auto text = nlohmann::json::parse(LinesText(network, &task, 0xabc, {}));
  CHECK(text.at("kind") == "lines");
  CHECK(text.at("hash") == "0000000000000abc");
  REQUIRE(text.at("curves").size() == 2);
  CHECK(text["curves"][0].at("name").get<std::string>().find('\n') == std::string::npos);
  CHECK(text["curves"][0].at("points_mm") == nlohmann::json({0, 0, 0, 10, 0, 0.13}));
  CHECK(text.at("target").at("at_mm") == nlohmann::json({10, 5, 0}));
  CHECK(text["target"].at("radius_mm") == 4);
  CHECK(text["target"].at("force_limit_mN") == 120);
  CHECK(text["target"].at("instrument") == 2);
  CHECK(text["target"].at("route_mm") == nlohmann::json({10, 0, 0, 10, 5, 0}));
  CHECK(nlohmann::json::parse(LinesText(network, nullptr, 1, {})).at("target").is_null());
}

TEST_CASE("Names from the bus stay within their text") {
  torquer_lcm::health_t health{};
  health.process = "x\", \"kind\": \"state\xff";
  health.state = std::string(5000, 'a');
  const auto text = nlohmann::json::parse(HealthText(health));
  CHECK(text["kind"] == "health");
  CHECK(text["state"].get<std::string>().size() < 100);
}
