// Programs that may run only once per session, started twice: the second ends with status 2 and
// names the first.
#include <catch2/catch.hpp>
#include <csignal>
#include <string>
#include <vector>

#include "tests/support/daemon_process.h"

namespace torquer::test {
namespace {

using Words = std::vector<std::string>;

struct Second {
  const char* name;
  Words first;             // first program, if any
  const char* first_says;  // its output once it runs
  Words second;
  bool other_folder;  // of claims: another user's
  std::vector<std::string> refusal;
};

const std::string kSimulator = ProgramPath("torquer-simulator");
const std::string kViewer = ProgramPath("torquer-viewer");

Words LiveIn(const std::string& scene) {
  return {kSimulator, "--scene", SourcePath("/host/scenes/" + scene + ".toml")};
}

std::vector<Second> Seconds(const Listener& listener) {
  const Words tube = LiveIn("drill_tube");
  const std::string log = listener.folder.Path("session.lcmlog");
  const Words emulator = {ProgramPath("torquer-emulator"),
                          "--socket",
                          listener.folder.Path("box"),
                          "--wait-client",
                          "--lcm-url",
                          "none",
                          "--duration",
                          "300"};
  return {
      {"simulator",
       tube,
       "running drill_tube",
       LiveIn("ty_phantom"),
       false,
       {"torquer-simulator (process ", ", scene drill_tube); stop that one first"}},
      {"another user's simulator",
       tube,
       "running drill_tube",
       tube,
       true,
       {"has a simulator, or a log player, already: ", "publishes wire states of guidewire; stop"}},
      {"steering viewer",
       {kViewer, "--steer"},
       "",
       {kViewer, "--steer"},
       false,
       {"steering on the bus at ", "another torquer-viewer (process "}},
      {"daemon of no instrument",
       tube,
       "running drill_tube",
       SocketWords(listener.folder.Path("none"), {"--uncalibrated", "--instrument", "cathteter"}),
       false,
       {"has no instrument 'cathteter'; it has guidewire: give one of these"}},
      {"recorder",
       {ProgramPath("torquer-recorder"), log},
       "",
       {ProgramPath("torquer-recorder"), log},
       false,
       {"session.lcmlog"}},
      {"emulator", emulator, "", emulator, false, {"box"}},
  };
}

bool Has(const std::string& text, const std::string& part) {
  return text.find(part) != std::string::npos;
}

}  // namespace

TEST_CASE("A second program of a session is refused with the name of the first") {
  Listener listener;
  for (const Second& row : Seconds(listener)) {
    CAPTURE(row.name);
    ChildProcess first(row.first);
    if (*row.first_says != '\0') {
      REQUIRE(first.WaitForError(row.first_says));
    } else if (row.first.front() == kViewer) {
      REQUIRE(listener.Until([&] { return Has(first.Output(), "http://"); }));
    } else {
      const std::string file = row.first[row.first[1] == "--socket" ? 2 : 1];
      REQUIRE(listener.Until([&] { return access(file.c_str(), F_OK) == 0; }));
    }
    const TemporaryFolder other;
    if (row.other_folder) setenv("XDG_RUNTIME_DIR", other.Path().c_str(), 1);
    ChildProcess second(row.second);
    setenv("XDG_RUNTIME_DIR", listener.folder.Path().c_str(), 1);
    CHECK(second.Wait() == 2);
    CAPTURE(second.Error());
    for (const std::string& part : row.refusal) CHECK(Has(second.Error(), part));
    // The first keeps running, and another one may start after it ends.
    first.Signal(SIGTERM);
    CHECK(first.Wait() <= 1);
  }
}

TEST_CASE("A viewer does not steer where a hand commands already") {
  Listener listener;
  torquer_lcm::instrument_command_t command{};
  command.instrument = protocol::kGuidewire;
  ChildProcess viewer({kViewer, "--steer"});
  const std::int64_t end_us = bus::MonotonicUs() + 10'000'000;
  while (viewer.Error().empty() && bus::MonotonicUs() < end_us) {
    listener.bus->Publish(protocol::kInstrumentCommandChannel, command);
    listener.bus->Handle(20);
  }
  CHECK(viewer.Wait() == 2);
  CHECK(Has(viewer.Error(), "'guidewire' gets commands from "));
}

TEST_CASE("Commands for an instrument that the scene does not have are named by the simulator") {
  Listener listener;
  ChildProcess simulator(LiveIn("drill_tube"));
  REQUIRE(simulator.WaitForError("running drill_tube"));
  torquer_lcm::instrument_command_t command{};
  command.instrument = "cathteter";
  CHECK(listener.Until([&] {
    ++command.sequence;
    listener.bus->Publish(protocol::kInstrumentCommandChannel, command);
    for (const auto& one : listener.health) {
      if (Has(one.message, "commands for 'cathteter' from ") &&
          Has(one.message, "the scene drill_tube has no such instrument; it has guidewire")) {
        return true;
      }
    }
    return false;
  }));
}

}  // namespace torquer::test
