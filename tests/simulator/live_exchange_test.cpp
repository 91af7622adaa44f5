// Instruments are exchanged in a live session, in its replay, and by a script.
#include <fmt/format.h>

#include <atomic>
#include <catch2/catch.hpp>
#include <fstream>
#include <functional>
#include <optional>
#include <sstream>
#include <string>
#include <torquer_lcm/exchange_command_t.hpp>
#include <torquer_lcm/health_t.hpp>
#include <vector>

#include "host/api/torquer/torquer.h"
#include "host/simulator/live_commands.h"
#include "host/simulator/program/script_run.h"
#include "host/simulator/replay.h"
#include "host/simulator/session_record.h"
#include "tests/simulator/live_scene.h"
#include "tests/support/private_network.h"
#include "tests/support/temporary_folder.h"

using Catch::Contains;
using torquer::simulator::LiveCommands;
using torquer::test::LiveScene;
using torquer::test::WaitFor;

namespace {

// A wire inside a catheter that is withdrawn at the start, with X-ray.
class TrayFile {
 public:
  TrayFile() {
    std::ofstream(path_) << "name = \"tray\"\n[vessel]\nkind = \"ty_phantom\"\n"
                            "wall_stiffness_N_mm2 = 0.01\n[entry]\ncenterline = \"main\"\n"
                            "at_mm = 1\n[relaxation]\nsegment_mm = 2\n"
                            "[[instrument]]\nname = \"wire\"\ndevice = \"sion\"\n"
                            "max_length_mm = 200\ninserted_at_start_mm = 120\n"
                            "[[instrument]]\nname = \"catheter\"\n"
                            "device = \"microcatheter_1_8f\"\nmax_length_mm = 200\n"
                            "[effects.wall_force]\nthreshold_mN = 0.01\n"
                            "[effects.fluoroscopy]\nwidth_px = 64\npictures_per_s = 60\n";
  }
  const std::string& path() const { return path_; }
  std::string Beside(const std::string& name) const { return folder_.Path() + "/" + name; }

 private:
  torquer::test::TemporaryFolder folder_;
  std::string path_ = folder_.Path() + "/tray.toml";
};

torquer_lcm::exchange_command_t OrderOf(std::int64_t order, const std::string& instrument,
                                        const std::string& device) {
  torquer_lcm::exchange_command_t command{};
  command.sequence = order;
  command.clock_id = torquer::bus::ClockId();
  command.order = order;
  command.instrument = instrument;
  command.device = device;
  return command;
}

// Sends an order until `done`.
bool Order(LiveScene& live, torquer_lcm::exchange_command_t order,
           const std::function<bool()>& done) {
  return WaitFor(live.hands(), [&] {
    ++order.sequence;
    live.hands().Publish(torquer::protocol::kExchangeCommandChannel, order);
    return done();
  });
}

}  // namespace

TEST_CASE("Live, a withdrawn instrument is exchanged once for each order, and a replay repeats it",
          "[simulator]") {
  torquer::test::NeedPrivateNetwork();
  const TrayFile file;
  std::int64_t states = 0;
  {
    LiveScene live(file.path());
    live.LogTo(file.Beside("log"));
    live.Start();
    live.command.xray = 1;
    REQUIRE(live.SendAndArrive("wire", 5, 0.2));
    const torquer_lcm::scene_description_t before = live.description();
    REQUIRE(Order(live, OrderOf(1, "catheter", "microcatheter_2_7f"),
                  [&] { return live.devices().exchange_count == 1; }));
    REQUIRE(live.SendAndArrive("catheter", 30, 0.1));
    CHECK(live.devices().devices == std::vector<std::string>{"sion", "microcatheter_2_7f"});
    CHECK(live.devices().exchange_count == 1);
    CHECK(live.devices().refusal.empty());
    CHECK(live.description().radius_mm[1] > before.radius_mm[1]);
    CHECK(live.description().content_hash == before.content_hash);
    CHECK(live.At("wire").insertion_mm == Approx(125));
    // Back again, and the catheter before.
    REQUIRE(live.SendAndArrive("catheter", 0, 0));
    REQUIRE(Order(live, OrderOf(500, "catheter", "microcatheter_1_8f"),
                  [&] { return live.devices().exchange_count == 2; }));
    REQUIRE(live.SendAndArrive("catheter", 20, 0));
    CHECK(live.description().radius_mm == before.radius_mm);
    CHECK(live.Stop().ticks > 0);
    states = live.state().tick + 1;
  }
  torquer::scene::Scene scene(file.path());
  const auto result = torquer::simulator::Replay(scene, file.Beside("log"));
  CHECK(result.states + result.missing == states);
  CHECK(result.differing == 0);
}

TEST_CASE("Live, an order that cannot be executed is refused with its reason", "[simulator]") {
  torquer::test::NeedPrivateNetwork();
  const TrayFile file;
  LiveScene live(file.path());
  std::string said;
  live.hands().Subscribe<torquer_lcm::health_t>(
      torquer::protocol::kHealthChannel,
      [&](const torquer_lcm::health_t& message) { said += message.message; });
  live.Start();
  REQUIRE(live.SendAndArrive("wire", 2, 0));
  const auto refused = [&](std::int64_t order, const std::string& instrument,
                           const std::string& device, const std::string& reason) {
    INFO(live.devices().refusal);
    CHECK(Order(live, OrderOf(order, instrument, device),
                [&] { return live.devices().refusal.find(reason) != std::string::npos; }));
  };
  refused(1, "wire", "samurai", "withdraw it to 0 mm first");
  refused(500, "catheter", "microcatheter_27f", "microcatheter_2_7f");
  refused(900, "catheter", "../devices/sion", "../devices/sion");
  refused(1300, "catheter", "sion", "catheter cannot be exchanged for the device sion");
  CHECK(live.devices().exchange_count == 0);
  REQUIRE(live.SendAndArrive("catheter", 20, 0));
  CHECK(Order(live, OrderOf(1700, "balloon", "sion"),
              [&] { return said.find("has no such instrument") != std::string::npos; }));
  CHECK_THAT(said, Contains("withdraw it to 0 mm first"));
}

TEST_CASE("Live, health has the time of a picture only after a picture", "[simulator]") {
  torquer::test::NeedPrivateNetwork();
  const TrayFile file;
  LiveScene live(file.path());
  std::vector<std::optional<std::int64_t>> picture_us;
  live.hands().Subscribe<torquer_lcm::health_t>(
      torquer::protocol::kHealthChannel,
      [&](const torquer_lcm::health_t& health) {
        picture_us.emplace_back();
        for (std::size_t k = 0; k < health.names.size(); ++k) {
          if (health.names[k] == "picture_us") picture_us.back() = health.values[k];
        }
      },
      0);
  live.Start();
  REQUIRE(WaitFor(live.hands(), [&] { return !picture_us.empty(); }));
  CHECK_FALSE(picture_us.front());
  live.command.xray = true;
  REQUIRE(live.Send("wire", 2, 0, [&] { return picture_us.back().has_value(); }));
  CHECK(*picture_us.back() > 0);
}

TEST_CASE("An order to exchange is taken once from one sender", "[simulator]") {
  const TrayFile file;
  const torquer::scene::Scene scene(file.path());
  LiveCommands commands(scene);
  constexpr torquer::bus::Sender kPage{0, 1001};
  constexpr torquer::bus::Sender kOther{0, 1002};
  constexpr std::int64_t kNowUs = 50'000'000;
  auto order = OrderOf(1, "catheter", "microcatheter_2_7f");
  commands.Take(order, kPage, kNowUs);
  const auto taken = commands.TakeExchange();
  REQUIRE(taken);
  CHECK(taken->instrument == 1);
  CHECK(taken->device == "microcatheter_2_7f");
  CHECK_FALSE(commands.TakeExchange());
  // The same order again; the sequence number rises.
  ++order.sequence;
  commands.Take(order, kPage, kNowUs + 100);
  CHECK_FALSE(commands.TakeExchange());
  // Another sender has to wait, and an older message has no effect.
  commands.Take(OrderOf(7, "wire", "sion"), kOther, kNowUs + 200);
  order.sequence = 0;
  order.order = 9;
  commands.Take(order, kPage, kNowUs + 300);
  CHECK_FALSE(commands.TakeExchange());
  commands.Take(OrderOf(1, "wire", "sion"), kOther, kNowUs + 100 + LiveCommands::kOwnedUs);
  REQUIRE(commands.TakeExchange());
  CHECK(commands.command().target == scene.start());
}

namespace {

std::string Script(const TrayFile& file, const std::string& rows) {
  const std::string path = file.Beside("script.csv");
  std::ofstream(path) << "time_s,wire.insertion_mm,catheter.insertion_mm,catheter.device\n" << rows;
  return path;
}

void RunTray(const TrayFile& file, const std::string& rows) {
  torquer::program::ScriptOutputs outputs;
  outputs.states = file.Beside("states.jsonl");
  outputs.record = file.Beside("record.json");
  const std::atomic<bool> stop{false};
  torquer::program::RunScript(torquer::Scene::FromFile(file.path()), Script(file, rows), outputs,
                              stop);
}

}  // namespace

TEST_CASE("A script exchanges an instrument before the row that names another device",
          "[simulator]") {
  const TrayFile file;
  RunTray(file,
          "0,0,0,\n0.1,5,0,microcatheter_2_7f\n0.2,5,10,microcatheter_2_7f\n0.3,5,0,\n"
          "0.4,5,20,microcatheter_1_8f\n");
  torquer::Simulation simulation(torquer::Scene::FromFile(file.path()));
  const auto step = [&](double time_s, double wire_mm, double catheter_mm) {
    torquer::Command command = simulation.command();
    command.time_s = time_s;
    command.hands[0].insertion_mm = 120 + wire_mm;
    command.hands[1].insertion_mm = catheter_mm;
    simulation.Step(command);
  };
  step(0, 0, 0);
  simulation.Exchange("catheter", "microcatheter_2_7f");
  step(0.1, 5, 0);
  step(0.2, 5, 10);
  step(0.3, 5, 0);
  simulation.Exchange("catheter", "microcatheter_1_8f");
  step(0.4, 5, 20);
  std::ifstream states(file.Beside("states.jsonl"));
  std::string line;
  std::string last;
  while (std::getline(states, line)) last = line;
  CHECK_THAT(last, Contains(fmt::format("\"state_hash\":\"{}\"", simulation.state_hash())));
  std::ifstream record(file.Beside("record.json"));
  std::stringstream text;
  text << record.rdbuf();
  CHECK(text.str() == simulation.Record());
  CHECK_THAT(text.str(), Contains("\"device\": \"microcatheter_2_7f\""));
  CHECK_THAT(text.str(), Contains("\"time_s\": 0.3"));
}

TEST_CASE("A script names file and line of an exchange that is not possible", "[simulator]") {
  const TrayFile file;
  CHECK_THROWS_WITH(RunTray(file, "0,0,0,microcatheter_27f\n"),
                    Contains("script.csv:2: catheter.device is 'microcatheter_27f'") &&
                        Contains("did you mean microcatheter_2_7f?"));
  CHECK_THROWS_WITH(RunTray(file, "0,0,0,\n0.1,0,10,\n0.2,0,20,microcatheter_2_7f\n"),
                    Contains("script.csv:4: catheter is inserted by 10 mm") &&
                        Contains("withdraw it to 0 mm first"));
}
