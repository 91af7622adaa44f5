// Crowded bus: strangers invent names, but a page still gets the session's messages.
#include <atomic>
#include <catch2/catch.hpp>
#include <chrono>
#include <set>
#include <string>
#include <thread>
#include <torquer_lcm/health_t.hpp>
#include <torquer_lcm/instrument_command_t.hpp>
#include <torquer_lcm/scene_description_t.hpp>
#include <torquer_lcm/wire_state_t.hpp>

#include "host/viewer/health_topics.h"
#include "host/viewer/shown_topics.h"
#include "host/viewer/viewer.h"
#include "protocol/lcm_channels.h"
#include "tests/support/private_network.h"
#include "tests/viewer/served_page.h"

using namespace torquer::viewer;
using namespace torquer::test;

namespace {

SharedPageMessage Words(const std::string& content) {
  return std::make_shared<const PageMessage>(PageMessage{content, true});
}

torquer_lcm::health_t HealthOf(const std::string& process, const std::string& instrument) {
  torquer_lcm::health_t health{};
  health.process = process;
  health.instrument = instrument;
  health.state = "running";
  return health;
}

torquer_lcm::scene_description_t SceneOf(const std::vector<std::string>& instruments) {
  torquer_lcm::scene_description_t scene{};
  scene.name = "crowded";
  scene.instruments = instruments;
  scene.instrument_count = static_cast<std::int32_t>(instruments.size());
  const std::vector<double> numbers(instruments.size(), 1);
  scene.radius_mm = scene.inner_radius_mm = scene.max_length_mm = scene.inserted_at_start_mm =
      numbers;
  return scene;
}

// Viewer in its own thread.
class ViewedBus {
 public:
  ViewedBus() : listening_(ListeningSocket(0)), port(PortOf(listening_)) {
    thread_ = std::thread([this] { RunViewer(bus_, listening_, kToken, ViewerSetup{}, stop_); });
  }
  ~ViewedBus() {
    stop_ = true;
    thread_.join();
  }
  ViewedBus(const ViewedBus&) = delete;
  ViewedBus& operator=(const ViewedBus&) = delete;

  void MakeUpNames() {
    for (int k = 0; k < 100; ++k) {
      const std::string number = std::to_string(k);
      Publish(HealthOf("made-up " + number, ""));
      Publish(HealthOf("daemon", "made-up " + number));
      torquer_lcm::instrument_command_t command{};
      command.instrument = "made-up " + number;
      sender.Publish(torquer::protocol::kInstrumentCommandChannel, command);
      // The pause keeps the viewer's queue from overflowing.
      if (k % 5 == 4) std::this_thread::sleep_for(std::chrono::milliseconds(2));
    }
  }
  void RunSession() {
    sender.Publish(torquer::protocol::kSceneChannel, SceneOf({"guidewire", "catheter"}));
    sender.Publish(torquer::protocol::kWireStateChannel, torquer_lcm::wire_state_t{});
    for (const char* process : {"simulator", "emulator"}) Publish(HealthOf(process, ""));
    for (const char* instrument : {"guidewire", "catheter"}) {
      Publish(HealthOf("daemon", instrument));
      torquer_lcm::instrument_command_t command{};
      command.instrument = instrument;
      command.flags = torquer::protocol::kCommandUncalibrated;
      sender.Publish(torquer::protocol::kInstrumentCommandChannel, command);
    }
  }

  // Kinds of session messages that a page has received: at least `enough`, or after 3000 messages.
  std::set<std::string> SeenBy(RawClient& page, std::size_t enough) const {
    std::set<std::string> seen;
    for (int k = 0; k < 3000 && seen.size() < enough; ++k) {
      const auto message = page.Next();
      if (!message) break;
      if (message->opcode == 2) seen.insert("state");
      for (const char* part :
           {R"("kind":"scene")", R"("process":"simulator")", R"("process":"emulator")",
            R"("instrument":"guidewire","kind":"health")",
            R"("instrument":"catheter","kind":"health")", R"("hands":[{"clutch")"}) {
        if (message->content.find(part) != std::string::npos) seen.insert(part);
      }
    }
    return seen;
  }

  torquer::bus::Bus sender;

 private:
  void Publish(const torquer_lcm::health_t& health) {
    sender.Publish(torquer::protocol::kHealthChannel, health);
  }

  torquer::bus::Bus bus_;
  int listening_;
  std::atomic<bool> stop_ = false;

 public:
  std::uint16_t port;

 private:
  std::thread thread_;
};

constexpr std::size_t kSessionParts = 7;

}  // namespace

TEST_CASE("A hundred made-up names hide no part of a session from a page") {
  NeedPrivateNetwork();
  const bool before = GENERATE(true, false);
  CAPTURE(before);
  ViewedBus viewed;
  RawClient page(viewed.port);
  const std::string host = "127.0.0.1:" + std::to_string(viewed.port);
  REQUIRE(page.Upgrade("/" + kToken + "/bus", host, "http://" + host));
  if (before) viewed.MakeUpNames();
  std::atomic<bool> end = false;
  std::thread session([&] {
    while (!end) {
      viewed.RunSession();
      if (!before) viewed.MakeUpNames();
      std::this_thread::sleep_for(std::chrono::milliseconds(10));
    }
  });
  const std::set<std::string> seen = viewed.SeenBy(page, kSessionParts);
  // A page that connects after the invented names.
  RawClient late(viewed.port);
  const bool let_in = late.Upgrade("/" + kToken + "/bus", host, "http://" + host);
  const std::set<std::string> seen_late = viewed.SeenBy(late, kSessionParts);
  end = true;
  session.join();
  CHECK(let_in);
  CAPTURE(seen, seen_late);
  CHECK(seen.size() == kSessionParts);
  CHECK(seen_late.size() == kSessionParts);
}

TEST_CASE("Passing topics replace only each other, and expire") {
  ShownTopics topics;
  ShownTopics::Time now{};
  topics.Show("scene", Words("scene"));
  std::size_t gone = 0;
  for (int k = 0; k < 100; ++k) {
    now += std::chrono::milliseconds(1);
    gone += topics.ShowPassing("made-up " + std::to_string(k), Words("x"), now).size();
  }
  CHECK(gone == 100 - ShownTopics::kMostPassing);
  topics.Show("state", Words("state"));
  CHECK(topics.newest().size() == ShownTopics::kMostPassing + 2);
  CHECK(topics.newest().contains("made-up 99"));
  CHECK_FALSE(topics.newest().contains("made-up 0"));
  // A topic shown again stays, and so does one that is now part of the session.
  topics.ShowPassing("made-up 98", Words("y"), now + std::chrono::seconds(9));
  topics.Show("made-up 97", Words("z"));
  CHECK(topics.Expire(now + std::chrono::seconds(12)).size() == ShownTopics::kMostPassing - 2);
  CHECK(topics.newest().size() == 4);
  CHECK(topics.Expire(now + std::chrono::seconds(20)) == std::vector<std::string>{"made-up 98"});
  topics.Forget("scene");
  CHECK(topics.newest().size() == 2);
}

TEST_CASE("A session needs its simulator, its emulator and its instruments' daemons") {
  HealthTopics topics;
  CHECK(topics.Needs(HealthOf("simulator", "")));
  CHECK_FALSE(topics.Needs(HealthOf("simulator", "made-up")));
  CHECK_FALSE(topics.Needs(HealthOf("daemon", "guidewire")));  // no scene yet
  CHECK(topics.Add(SceneOf({"guidewire", "catheter"})).empty());
  CHECK(topics.Needs(HealthOf("daemon", "guidewire")));
  CHECK_FALSE(topics.Needs(HealthOf("daemon", "made-up")));
  CHECK_FALSE(topics.Needs(HealthOf("made-up", "guidewire")));
  CHECK(topics.Add(SceneOf({"guidewire"})) == std::vector<std::string>{"health/daemon/catheter"});
  CHECK(topics.Add(SceneOf(std::vector<std::string>(1000, "wire"))).size() == 1);
}
