// Judge of a session: the marks follow from the commands, not from the load of the machine.
#include <sys/wait.h>

#include <algorithm>
#include <catch2/catch.hpp>
#include <cmath>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <functional>
#include <lcm/lcm-cpp.hpp>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "host/recorder/session_judge.h"
#include "host/simulator/exchangeable_simulation.h"
#include "host/simulator/scene_message.h"
#include "host/support/fnv1a.h"
#include "protocol/lcm_channels.h"
#include "tests/support/paths.h"
#include "tests/support/scenes.h"
#include "torquer_lcm/health_t.hpp"
#include "torquer_lcm/injector_command_t.hpp"
#include "torquer_lcm/instrument_command_t.hpp"
#include "torquer_lcm/readings_t.hpp"
#include "torquer_lcm/table_command_t.hpp"
#include "torquer_lcm/wedge_command_t.hpp"

using torquer::FindReading;
using torquer::SessionJudgment;
using torquer::test::SceneFile;

namespace {

constexpr char kJudgedTask[] =
    "[effects.friction]\ncoefficient = 0.1\n"
    "[effects.wall_force]\nthreshold_mN = 2\n"
    "[effects.assessment]\ntarget_centerline = \"main\"\ntarget_at_mm = 140\n"
    "target_radius_mm = 5\nforce_limit_mN = 500\n";
constexpr std::int64_t kJudgedClock = 4711;
constexpr std::int64_t kSimulatorBeganUs = 90'000'123;
constexpr std::int64_t kCommandEveryUs = 10'000;
constexpr int kCommandCount = 80;

// Machine that runs a session: `busy` ticks rarely, with little work, and publishes late.
struct Machine {
  bool busy = false;
  /// May change a command on its way to the log, or drop it by returning false.
  std::function<bool(torquer_lcm::instrument_command_t&)> spoil = [](auto&) { return true; };
  std::int64_t refused_senders = 0;
  std::int64_t first_tick_sequence = -1;  // newest command that the first state shows
  bool restarts = false;                  // the simulator counts its ticks from 0 again
  double injector_mL = 0;                 // 0: no command for the power injector
  double wedge_share = 0;                 // 0: no command for the wedges, as in logs before it
  double table_left_mm = 0;               // 0: no command for the table, as in logs before it
  std::string device;                     // for which the catheter is exchanged; "": no exchange
  double catheter_mm = 0;                 // its insertion from command 20 on; 0: no command
  std::uint64_t device_hash = 0;          // of its values in the log; 0: those that it has
};

class JudgedLog {
 public:
  explicit JudgedLog(const std::string& path) : log_(path, "w") {}

  template <class Message>
  void Write(const char* channel, const Message& message) {
    std::vector<std::uint8_t> bytes(static_cast<std::size_t>(message.getEncodedSize()));
    message.encode(bytes.data(), 0, static_cast<int>(bytes.size()));
    lcm::LogEvent event{};
    event.timestamp = 1'700'000'000'000'000;
    event.channel = channel;
    event.data = bytes.data();
    event.datalen = static_cast<int>(bytes.size());
    log_.writeEvent(&event);
  }

 private:
  lcm::LogFile log_;
};

// Command number `i`, published kCommandEveryUs after the one before. The motion is 20 mm in with
// half a turn, then a rest. X-ray is on from command 20 to 59.
torquer_lcm::instrument_command_t HandAt(int i) {
  torquer_lcm::instrument_command_t command{};
  command.instrument = "guidewire";
  command.sequence = i;
  command.clock_id = kJudgedClock;
  command.publish_us = kSimulatorBeganUs + kCommandEveryUs * (i + 1);
  command.origin_us = command.publish_us - 500;
  command.insertion_mm = 20 * std::min(1.0, i / 40.0);
  command.rotation_rad = 3 * std::min(1.0, i / 40.0);
  command.xray = i >= 20 && i < 60;
  return command;
}

void PublishJudged(torquer::simulator::Simulation& simulation, const Machine& machine, int i,
                   std::int64_t began_us, JudgedLog& log) {
  torquer_lcm::wire_state_t state{};
  simulation.Describe(state);
  state.clock_id = kJudgedClock;
  state.solve_us = machine.busy ? 9000 : 300;
  // The first state comes in time on both machines, the later ones of the busy machine late. No
  // state comes at once.
  state.publish_us = began_us + static_cast<std::int64_t>(1e6 * state.time_s + state.solve_us) +
                     (machine.busy && i >= 0 ? 7000 : 20);
  if (state.tick == 0) state.solve_us = 0;
  if (state.tick == 0) state.publish_us = began_us + (machine.busy ? 700 : 5);
  for (auto& instrument : state.instruments) instrument.command_sequence = -1;
  state.instruments[0].command_sequence = i < 0 ? machine.first_tick_sequence : i;
  log.Write(torquer::protocol::kWireStateChannel, state);
  torquer_lcm::readings_t readings{};
  for (const torquer::effects::Reading& reading : simulation.Readings()) {
    readings.names.push_back(reading.name);
    readings.values.push_back(reading.value);
  }
  readings.count = static_cast<std::int32_t>(readings.names.size());
  readings.publish_us = state.publish_us;
  log.Write(torquer::protocol::kReadingsChannel, readings);
}

// Records a session; returns a reading of the live simulator at its end.
double RecordJudged(const SceneFile& file, const Machine& machine, const std::string& reading) {
  torquer::scene::Scene scene(file.path());
  torquer::simulator::ExchangeableSimulation running(scene);
  JudgedLog log(file.Beside("log"));
  log.Write(torquer::protocol::kSceneChannel, torquer::simulator::Describe(running.now()));
  PublishJudged(running.now(), machine, -1, kSimulatorBeganUs, log);
  const torquer::InstrumentPose start = scene.start()[0];
  for (int i = 0; i < kCommandCount; ++i) {
    torquer_lcm::instrument_command_t command = HandAt(i);
    torquer::simulator::Command live;
    live.target = scene.start();
    live.target[0] = {start.insertion_mm + command.insertion_mm, command.rotation_rad};
    live.controls.xray = command.xray;
    live.time_s = 1e-6 * static_cast<double>(command.publish_us - kSimulatorBeganUs + 500);
    if (machine.table_left_mm != 0 && i == 10) {
      torquer_lcm::table_command_t table{};
      table.instrument = command.instrument;
      table.clock_id = kJudgedClock;
      table.publish_us = command.publish_us - 100;
      table.left_mm = machine.table_left_mm;
      log.Write(torquer::protocol::kTableCommandChannel, table);
    }
    // Armed, then ordered to inject until command 40. Later ones are missing.
    if (machine.injector_mL != 0 && i >= 10 && i <= 40) {
      torquer_lcm::injector_command_t injector{};
      injector.sequence = i;
      injector.clock_id = kJudgedClock;
      injector.publish_us = command.publish_us - 100;
      injector.order = i < 12 ? 1 : 2;
      injector.volume_mL = machine.injector_mL;
      injector.rate_mL_s = injector.delay_s = injector.rise_s = -1;
      log.Write(torquer::protocol::kInjectorCommandChannel, injector);
    }
    if (machine.wedge_share != 0 && i == 10) {
      torquer_lcm::wedge_command_t wedges{};
      wedges.clock_id = kJudgedClock;
      wedges.publish_us = command.publish_us - 100;
      wedges.share[0] = machine.wedge_share;
      log.Write(torquer::protocol::kWedgeCommandChannel, wedges);
    }
    if (!machine.device.empty() && i == 10) {
      running.Exchange(1, machine.device);
      auto devices = torquer::simulator::DescribeDevices(running.now(), "");
      if (machine.device_hash != 0) devices.exchange_hash[0] = torquer::Hex(machine.device_hash);
      log.Write(torquer::protocol::kDevicesChannel, devices);
    }
    if (machine.catheter_mm != 0 && i >= 20) {
      torquer_lcm::instrument_command_t catheter = command;
      catheter.instrument = "catheter";
      catheter.insertion_mm = live.target[1].insertion_mm =
          machine.catheter_mm * std::min(1.0, (i - 19) / 40.0);
      catheter.rotation_rad = 0;
      log.Write(torquer::protocol::kInstrumentCommandChannel, catheter);
    }
    if (machine.spoil(command)) log.Write(torquer::protocol::kInstrumentCommandChannel, command);
    if (machine.busy && i % 3 != 2) continue;
    torquer::CountedBudget budget(machine.busy ? 1 : 5000);
    running.now().Tick(live, budget);
    PublishJudged(running.now(), machine, i, kSimulatorBeganUs, log);
  }
  if (machine.restarts) {
    running.now().Restart();
    PublishJudged(running.now(), machine, kCommandCount - 1, kSimulatorBeganUs + 2'000'000, log);
  }
  torquer_lcm::health_t health{};
  health.process = "simulator";
  health.state = "stopping";
  health.publish_us = kSimulatorBeganUs + 1'500'000;
  health.names = {"refused_senders"};
  health.values = {machine.refused_senders};
  health.count = 1;
  log.Write(torquer::protocol::kHealthChannel, health);
  for (const torquer::effects::Reading& one : running.now().Readings()) {
    if (one.name == reading) return one.value;
  }
  return std::nan("");
}

SessionJudgment JudgeFile(const SceneFile& file) {
  torquer::scene::Scene scene(file.path());
  return torquer::JudgeSession(scene, file.Beside("log"));
}

std::string ReasonOf(const Machine& machine) {
  const SceneFile file(kJudgedTask);
  RecordJudged(file, machine, "");
  const SessionJudgment judgment = JudgeFile(file);
  CHECK(judgment.not_gradable.empty() == judgment.repeated());
  return judgment.not_gradable;
}

}  // namespace

TEST_CASE("The same commands on a busy and on an idle machine give the same marks") {
  const SceneFile idle(kJudgedTask);
  const SceneFile busy(kJudgedTask);
  const double idle_s = RecordJudged(idle, {}, "wall_force_unconverged_s");
  Machine machine;
  machine.busy = true;
  const double busy_s = RecordJudged(busy, machine, "wall_force_unconverged_s");
  CHECK(idle_s == 0);
  CHECK(busy_s > 0.3);  // the live readings of the busy machine are of no use

  const SessionJudgment on_idle = JudgeFile(idle);
  const SessionJudgment on_busy = JudgeFile(busy);
  CHECK(on_idle.not_gradable.empty());
  REQUIRE(on_idle.repeated());
  CHECK(on_idle.readings.names == on_busy.readings.names);
  for (std::size_t i = 0; i < on_idle.readings.values.size(); ++i) {
    INFO(on_idle.readings.names[i]);
    const double one = on_idle.readings.values[i];
    const double other = on_busy.readings.values[i];
    CHECK((one == other || (std::isnan(one) && std::isnan(other))));
  }
  CHECK(FindReading(on_busy.readings, "wall_force_unconverged_s") == 0);
  CHECK(*FindReading(on_busy.readings, "wall_force_largest_ever_mN") > 0);
  CHECK(on_idle.course.tip_path_mm() == on_busy.course.tip_path_mm());
  CHECK(on_idle.course.tip_path_mm() > 10);
}

TEST_CASE("A replay has the hands, the pedals and the length of the session") {
  const SceneFile file(kJudgedTask);
  RecordJudged(file, {}, "");
  const SessionJudgment judgment = JudgeFile(file);
  REQUIRE(judgment.course.instruments().size() == 1);
  CHECK(judgment.course.instruments()[0].insertion_mm.last().value == Approx(140));
  CHECK(judgment.course.instruments()[0].rotation_deg.last().value == Approx(171.887));
  CHECK(*FindReading(judgment.readings, "fluoroscopy_s") == Approx(0.4).margin(0.01));
  CHECK(judgment.course.xray().total_s() == Approx(0.4).margin(0.01));
  CHECK(*FindReading(judgment.readings, "procedure_s") == Approx(1.5).margin(0.01));
  CHECK(FindReading(judgment.readings, "target_reached") == 1);
}

namespace {

// Readings of a judged session in a scene with X-ray.
auto ReadingsWithXray(const Machine& machine) {
  const SceneFile file(std::string(kJudgedTask) + "[effects.fluoroscopy]\nwidth_px = 64\n");
  RecordJudged(file, machine, "");
  const SessionJudgment judgment = JudgeFile(file);
  CHECK(judgment.not_gradable.empty());
  return judgment.readings;
}

}  // namespace

TEST_CASE("A replay has the table's position, and the dose there") {
  // Beside the spine the beam goes through less.
  const auto judged = [](double left_mm) {
    Machine machine;
    machine.table_left_mm = left_mm;
    const auto readings = ReadingsWithXray(machine);
    CHECK(FindReading(readings, "table_left_mm") == left_mm);
    return *FindReading(readings, "air_kerma_mGy");
  };
  const double without = judged(0);
  CHECK(without > 0);
  CHECK(judged(60) < 0.9 * without);
}

TEST_CASE("A replay has the wedges, and the dose behind them") {
  const auto judged = [](double share) {
    Machine machine;
    machine.wedge_share = share;
    return *FindReading(ReadingsWithXray(machine), "kerma_area_Gy_cm2");
  };
  const double without = judged(0);
  CHECK(without > 0);
  // Half of the width is behind 0.5 mm of copper. At its edge is a ramp of a tenth of the width.
  const double copper = 0.05 * 8.96 * 1.593;
  const double through = std::exp(-copper);
  const double ramp = (1 - through) / copper;
  CHECK(judged(0.5) == Approx((0.5 + 0.1 * ramp + 0.4 * through) * without).epsilon(1e-3));
}

TEST_CASE("A replay has the injections, and aborts one whose sender is silent, as live") {
  const auto judged = [](double volume_mL) {
    const SceneFile file(std::string(kJudgedTask) +
                         "[effects.flow]\ninlet = \"main\"\ninlet_mL_s = 5\n"
                         "[effects.contrast]\nrate_mL_s = 1\ninjector_volume_mL = 3\n"
                         "injector_rate_mL_s = 4\n");
    Machine machine;
    machine.injector_mL = volume_mL;
    RecordJudged(file, machine, "");
    const SessionJudgment judgment = JudgeFile(file);
    CHECK(judgment.not_gradable.empty());
    REQUIRE(judgment.course.injections().size() == 1);
    const torquer::PowerInjection injection = judgment.course.injections()[0];
    CHECK(FindReading(judgment.readings, "contrast_injected_mL") == Approx(injection.delivered_mL));
    CHECK(injection.start_s == Approx(1e-6 * kCommandEveryUs * 13).margin(0.011));
    CHECK(injection.volume_mL == volume_mL);
    CHECK(injection.rate_mL_s == 4);
    return injection;
  };
  CHECK(judged(2).complete());
  const auto aborted = judged(5);
  CHECK(aborted.aborted);
  // 28 periods from the first order to the last, and 0.3 s of silence.
  CHECK(aborted.delivered_mL == Approx(4 * (28 * 0.01 + 0.3)).margin(4 * 0.021));
}

TEST_CASE("A replay has the exchange of an instrument") {
  const auto judged = [](const std::string& at_start, const Machine& machine) {
    const SceneFile file(std::string(kJudgedTask) +
                         "[[instrument]]\nname = \"catheter\"\nmax_length_mm = 100\ndevice = \"" +
                         at_start + "\"\n");
    RecordJudged(file, machine, "");
    return JudgeFile(file);
  };
  Machine machine;
  machine.catheter_mm = 60;
  const SessionJudgment soft = judged("microcatheter_2_7f", machine);
  const SessionJudgment stiff = judged("diagnostic_4f", machine);
  machine.device = "diagnostic_4f";
  const SessionJudgment exchanged = judged("microcatheter_2_7f", machine);
  CHECK(exchanged.not_gradable.empty());
  // As if the withdrawn catheter had been that device from the start.
  const std::string force = "wall_force_largest_ever_mN";
  const double stiff_mN = *FindReading(stiff.readings, force);
  CHECK(*FindReading(exchanged.readings, force) == stiff_mN);
  CHECK(*FindReading(soft.readings, force) != stiff_mN);
  CHECK(exchanged.course.tip_path_mm() == stiff.course.tip_path_mm());

  machine.device_hash = 5;
  CHECK_THAT(judged("microcatheter_2_7f", machine).not_gradable,
             Catch::Contains("the device diagnostic_4f has other values than in the recording"));
}

TEST_CASE("Pedals of a silent sender are up in a replay, as live") {
  const SceneFile file(kJudgedTask);
  Machine machine;
  // After command 29 nothing comes: the pedal has been down since command 20.
  machine.spoil = [](const auto& command) { return command.sequence < 30; };
  RecordJudged(file, machine, "");
  const SessionJudgment judgment = JudgeFile(file);
  CHECK(judgment.not_gradable.empty());
  CHECK(*FindReading(judgment.readings, "fluoroscopy_s") == Approx(0.39).margin(0.025));
}

TEST_CASE("A session is not gradable if its commands do not decide the marks") {
  Machine gap;
  gap.spoil = [](const auto& command) { return command.sequence != 30; };
  CHECK_THAT(ReasonOf(gap), Catch::Contains("lacks 1 of the commands"));

  Machine clock;
  clock.spoil = [](auto& command) { return command.clock_id = kJudgedClock + 1, true; };
  CHECK_THAT(ReasonOf(clock), Catch::Contains("another clock"));

  Machine refused;
  refused.refused_senders = 3;
  CHECK_THAT(ReasonOf(refused), Catch::Contains("second sender"));

  Machine late;
  late.first_tick_sequence = 400;
  CHECK_THAT(ReasonOf(late), Catch::Contains("after the first commands"));

  Machine restarts;
  restarts.restarts = true;
  CHECK_THAT(ReasonOf(restarts), Catch::Contains("restarted"));

  Machine time;
  time.spoil = [](auto& command) {
    if (command.sequence == 50) command.publish_us = 0;
    return true;
  };
  CHECK_THAT(ReasonOf(time), Catch::Contains("impossible time"));
}

TEST_CASE("A session of another scene and a damaged one are not gradable") {
  const SceneFile file(kJudgedTask);
  RecordJudged(file, {}, "");
  const SceneFile other(std::string(kJudgedTask) + "[relaxation]\nbudget_us = 600\n");
  std::filesystem::copy(file.Beside("log"), other.Beside("log"));
  CHECK_THAT(JudgeFile(other).not_gradable, Catch::Contains("other contents of the scene"));

  std::fstream log(file.Beside("log"), std::ios::in | std::ios::out | std::ios::binary);
  log.seekp(static_cast<std::streamoff>(std::filesystem::file_size(file.Beside("log")) / 2));
  log << std::string(4000, '\0');
  log.close();
  CHECK_THAT(JudgeFile(file).not_gradable, Catch::Contains("damaged"));
}

TEST_CASE("A scene without observers is not judged") {
  const SceneFile file;
  RecordJudged(file, {}, "");
  const SessionJudgment judgment = JudgeFile(file);
  CHECK(judgment.not_gradable.empty());
  CHECK_FALSE(judgment.repeated());
}

TEST_CASE("The program compares a session with the expert run beside its scene") {
  const SceneFile file(kJudgedTask);
  RecordJudged(file, {}, "");
  const auto json = [&file] {
    const std::string out = file.Beside("out");
    const std::string command = torquer::test::ProgramPath("torquer-report") + " " +
                                file.Beside("log") + " --json --trainee Ann --scene " +
                                file.path() + " >" + out;
    CHECK(WIFEXITED(std::system(command.c_str())));
    return nlohmann::json::parse(std::ifstream(out));
  };
  CHECK(json()["expert"].is_null());
  std::filesystem::create_directory(file.Beside("experts"));
  std::ofstream(file.Beside("experts/small.csv"))
      << "time_s,guidewire.insertion_mm,xray\n0,0,1\n2,20,1\n3,15,1\n";
  const auto report = json();
  CHECK(report["trainee"] == "Ann");
  CHECK(report["expert"]["script"] == file.Beside("experts/small.csv"));
  CHECK(report["expert"]["readings"]["procedure_s"].get<double>() == Approx(3));
  CHECK(report["expert"]["readings"]["retracted_mm"].get<double>() == Approx(5));
  CHECK(report["readings"]["retracted_mm"].get<double>() == 0);
}
