#include "host/viewer/recording.h"

#include <catch2/catch.hpp>
#include <fstream>
#include <string>
#include <torquer_lcm/health_t.hpp>
#include <torquer_lcm/picture_t.hpp>
#include <torquer_lcm/scene_description_t.hpp>
#include <torquer_lcm/vital_signs_t.hpp>
#include <torquer_lcm/wire_state_t.hpp>
#include <vector>

#include "host/bus/message_check.h"
#include "host/bus/state_outline.h"
#include "host/support/event_log_writer.h"
#include "protocol/lcm_channels.h"
#include "tests/support/file_contents.h"
#include "tests/support/temporary_folder.h"
#include "tests/viewer/recorded_message.h"

using Catch::Contains;
using torquer::EventLogWriter;
using torquer::test::kBeginUs;
using torquer::test::TemporaryFolder;
using torquer::test::Write;
using torquer::viewer::Recording;

namespace {

torquer_lcm::wire_state_t State(std::int64_t tick) {
  torquer_lcm::wire_state_t state{};
  state.tick = tick;
  return state;
}

torquer_lcm::health_t Health(const std::string& process) {
  torquer_lcm::health_t health{};
  health.process = process;
  health.state = "running";
  return health;
}

std::int64_t TickAt(const Recording& recording, std::int64_t at_us) {
  const Recording::Topic& states = recording.states();
  const auto bytes = recording.Read(states, states.CountAt(at_us) - 1);
  torquer_lcm::wire_state_t state{};
  REQUIRE(torquer::bus::DecodeMessage(bytes.data(), bytes.size(), state));
  return state.tick;
}

const Recording::Topic* Find(const Recording& recording, const std::string& name) {
  for (const auto& topic : recording.topics()) {
    if (topic.name == name) return &topic;
  }
  return nullptr;
}

}  // namespace

TEST_CASE("A recording gives the newest of each topic at any moment") {
  const TemporaryFolder folder;
  const std::string path = folder.Path("log");
  {
    EventLogWriter log(path);
    Write(log, 0, torquer::protocol::kHealthChannel, Health("daemon"));
    Write(log, 1000, torquer::protocol::kWireStateChannel, State(1));
    log.Write(kBeginUs + 1500, "SOMETHING_ELSE", std::vector<std::uint8_t>{1, 2, 3});
    Write(log, 2000, torquer::protocol::kHealthChannel, Health("simulator"));
    Write(log, 3000, torquer::protocol::kWireStateChannel, State(2));
    // The wall clock is set back.
    Write(log, -500000, torquer::protocol::kWireStateChannel, State(3));
    Write(log, 9000, torquer::protocol::kHealthChannel, Health("daemon"));
    log.Write(kBeginUs + 9000, torquer::protocol::kHealthChannel, std::vector<std::uint8_t>{7});
    log.Finish();
  }
  const Recording recording(path);
  CHECK(recording.length_us() == 9000);
  CHECK(recording.topics().size() == 3);
  CHECK(recording.states().times_us == std::vector<std::int64_t>{1000, 3000, 3000});
  CHECK(recording.states().CountAt(999) == 0);
  CHECK(TickAt(recording, 1000) == 1);
  CHECK(TickAt(recording, 2999) == 1);
  CHECK(TickAt(recording, 3000) == 3);
  CHECK(TickAt(recording, 9000) == 3);
  REQUIRE(Find(recording, "health/daemon/") != nullptr);
  CHECK(Find(recording, "health/daemon/")->times_us == std::vector<std::int64_t>{0, 9000});
  REQUIRE(Find(recording, "health/simulator/") != nullptr);
  CHECK_FALSE(recording.damage().any());
}

TEST_CASE("A recording has the pictures of both planes, and the patient's curves") {
  const TemporaryFolder folder;
  const std::string path = folder.Path("log");
  {
    EventLogWriter log(path);
    Write(log, 0, torquer::protocol::kWireStateChannel, State(1));
    Write(log, 1000, torquer::protocol::kPictureChannel, torquer_lcm::picture_t{});
    Write(log, 2000, torquer::protocol::kLateralPictureChannel, torquer_lcm::picture_t{});
    Write(log, 3000, torquer::protocol::kVitalSignsChannel, torquer_lcm::vital_signs_t{});
    log.Finish();
  }
  const Recording recording(path);
  for (const char* channel :
       {torquer::protocol::kPictureChannel, torquer::protocol::kLateralPictureChannel,
        torquer::protocol::kVitalSignsChannel}) {
    INFO(channel);
    REQUIRE(Find(recording, channel) != nullptr);
    CHECK(Find(recording, channel)->times_us.size() == 1);
  }
}

TEST_CASE("A recording shows the states that have their shape") {
  const TemporaryFolder folder;
  {
    EventLogWriter log(folder.Path("log"));
    for (int tick = 1; tick <= 10; ++tick) {
      torquer_lcm::wire_state_t state = State(tick);
      state.nodes_mm.assign(5, {1, 2, 3});
      state.node_count = 5;
      state.segment_count = 4;
      state.stride = 1;
      if (tick % 4 != 0) torquer::bus::ReduceToOutline(state);
      Write(log, 1000 * tick, torquer::protocol::kWireStateChannel, state);
    }
    log.Finish();
  }
  const Recording recording(folder.Path("log"));
  CHECK(recording.states().times_us == std::vector<std::int64_t>{3000, 7000});
  CHECK(recording.length_us() == 9000);
  CHECK(TickAt(recording, 6999) == 4);
}

TEST_CASE("A recording with many processes keeps its states") {
  const TemporaryFolder folder;
  const std::string path = folder.Path("log");
  {
    EventLogWriter log(path);
    for (int k = 0; k < 500; ++k) {
      Write(log, k, torquer::protocol::kHealthChannel, Health("p" + std::to_string(k)));
    }
    Write(log, 1000, torquer::protocol::kWireStateChannel, State(1));
    log.Finish();
  }
  const Recording recording(path);
  CHECK(recording.topics().size() < 64);
  CHECK(TickAt(recording, 1000) == 1);
}

TEST_CASE("A log without states is refused, and damage is named") {
  const TemporaryFolder folder;
  {
    EventLogWriter log(folder.Path("empty"));
    Write(log, 0, torquer::protocol::kHealthChannel, Health("daemon"));
    log.Finish();
    EventLogWriter whole(folder.Path("cut"));
    for (int k = 0; k < 20; ++k) {
      Write(whole, 1000 * k, torquer::protocol::kWireStateChannel, State(k));
    }
    whole.Finish();
  }
  CHECK_THROWS_WITH(Recording(folder.Path("empty")), Contains("holds no wire state"));
  CHECK_THROWS_WITH(Recording(folder.Path("none")), Contains("cannot be read"));
  std::filesystem::resize_file(folder.Path("cut"),
                               std::filesystem::file_size(folder.Path("cut")) - 5);
  const Recording cut(folder.Path("cut"));
  CHECK(cut.damage().cut);
  CHECK(TickAt(cut, cut.length_us()) == 18);
}

TEST_CASE("A recording of two joined logs is refused") {
  const TemporaryFolder folder;
  {
    EventLogWriter log(folder.Path("one"));
    for (int k = 0; k < 5; ++k) {
      Write(log, 1000 * k, torquer::protocol::kWireStateChannel, State(k));
    }
    log.Finish();
  }
  const std::string log = torquer::test::Contents(folder.Path("one"));
  std::ofstream(folder.Path("both"), std::ios::binary) << log << log;
  CHECK_THROWS_WITH(Recording(folder.Path("both")), Contains("both: 2 logs are joined in it") &&
                                                        Contains("give each log by itself"));
}
