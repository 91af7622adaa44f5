// torquer-simulator: runs a scene live on the bus, from a script, or again from a log.
#include <fmt/format.h>

#include <atomic>
#include <chrono>
#include <nlohmann/json.hpp>
#include <optional>
#include <string>
#include <vector>

#include "host/api/torquer/torquer.h"
#include "host/bus/bus.h"
#include "host/simulator/effect_prices.h"
#include "host/simulator/exchangeable_simulation.h"
#include "host/simulator/explain.h"
#include "host/simulator/live_loop.h"
#include "host/simulator/program/script_run.h"
#include "host/simulator/replay.h"
#include "host/simulator/scene/key_reference.h"
#include "host/simulator/scene/scene.h"
#include "host/simulator/session_record.h"
#include "host/simulator/sole_simulator.h"
#include "host/simulator/vessel/mesh_check.h"
#include "host/simulator/vessel/mesh_import.h"
#include "host/simulator/vessel/mesh_picture.h"
#include "host/support/atomic_file.h"
#include "host/support/error.h"
#include "host/support/error_output.h"
#include "host/support/printable_text.h"
#include "host/support/program.h"
#include "host/support/realtime.h"
#include "host/support/stop_signal.h"

namespace {

// Saves the built part of the vessel's field for the next run, however this run ends.
template <class Keep>
class AtTheEnd {
 public:
  explicit AtTheEnd(Keep keep) : keep_(keep) {}
  AtTheEnd(const AtTheEnd&) = delete;
  AtTheEnd& operator=(const AtTheEnd&) = delete;
  ~AtTheEnd() {
    const std::string problem = keep_();
    if (!problem.empty()) torquer::PrintError("torquer-simulator: {}\n", problem);
  }

 private:
  const Keep keep_;
};

auto KeepField(const torquer::scene::Scene& scene) {
  return AtTheEnd([&scene] { return scene.KeepField(); });
}

void Say(const std::vector<std::string>& findings) {
  for (const std::string& finding : findings) {
    torquer::PrintError("torquer-simulator: {}\n", finding);
  }
}

std::int64_t NowNs() {
  return std::chrono::steady_clock::now().time_since_epoch() / std::chrono::nanoseconds(1);
}

int Live(torquer::scene::Scene& scene, const std::string& url, const std::string& record_file,
         bool examination, bool realtime, bool json) {
  if (realtime) torquer::EnterRealtime();  // before the bus, whose thread inherits it
  torquer::bus::Bus bus(url);
  torquer::simulator::SoleSimulator sole(bus.url(), scene.name());
  torquer::simulator::EffectPrices prices(scene.names_of_effects(), NowNs);
  torquer::simulator::ExchangeableSimulation simulation(scene, &prices);
  std::optional<torquer::simulator::SessionRecord> record;
  if (!record_file.empty()) {
    record.emplace(record_file, scene.path(), !simulation.now().Readings().empty());
  }
  const std::atomic<bool>& stop = torquer::StopOnSignal();
  sole.Listen();
  torquer::PrintError("torquer-simulator: running {} on {}\n", scene.name(), bus.url());
  const torquer::simulator::LiveStatistics run = torquer::simulator::RunLive(simulation, bus, stop);
  if (record) record->Finish(torquer::simulator::FormatRecord(simulation.now(), examination));
  if (json) {
    nlohmann::json line = {
        {"ticks", run.ticks}, {"commands", run.commands}, {"unconverged", run.unconverged}};
    const auto add = [&line](const std::string& name, std::optional<double> us) {
      line[name] = us ? nlohmann::json(*us) : nullptr;
    };
    add("command_to_state_us_p50", run.command_to_state.Quantile(0.5));
    add("command_to_state_us_p99", run.command_to_state.Quantile(0.99));
    add("command_to_state_us_max", run.command_to_state.largest_us());
    add("solve_us_p50", run.solve.Quantile(0.5));
    add("solve_us_p99", run.solve.Quantile(0.99));
    add("solve_us_max", run.solve.largest_us());
    fmt::print("{}\n", line.dump());
  }
  return 0;
}

struct Arguments {
  std::string scene;
  std::string url;
  std::string script;
  torquer::program::ScriptOutputs outputs;
  std::string log;
  std::string explained;
  std::string surface;
  std::string picture;
  bool examination = false;
  bool realtime = false;
  bool json = false;
  bool list_effects = false;
  bool list_keys = false;
  bool markdown = false;
  bool schema = false;
};

void Declare(torquer::Options& options, Arguments& arguments) {
  using torquer::ValueKind;
  options.Group("Live session with commands from the bus, until Ctrl-C");
  options.Text("--scene", "FILE", arguments.scene,
               "scene file, or name of a scene that Torquer ships", ValueKind::kFile);
  options.Text(
      "--lcm-url", "URL", arguments.url,
      "URL of the message bus; without it LCM_DEFAULT_URL, or else multicast on this machine");
  options.Flag(
      "--realtime", arguments.realtime,
      "run with real-time priority, before all ordinary programs, and lock the memory in RAM");
  options.Flag("--json", arguments.json,
               "print ticks, latency and times as one line of JSON at the end");
  options.Text("--record", "FILE", arguments.outputs.record,
               "write the readings of the observers as JSON at the end; also allowed with --script",
               ValueKind::kFile);
  options.Flag("--examination", arguments.examination,
               "note in the record that the session is an examination, not practice");
  options.Group("Simulation of a script, without a bus");
  options.Text("--script", "FILE", arguments.script,
               "CSV file of commands; the column time_s is required; optional columns are "
               "NAME.insertion_mm, NAME.rotation_rad and NAME.device per instrument, and those of "
               "the C-arm, X-ray, table and injections; -: read rows from standard input and "
               "execute each at once",
               ValueKind::kFile);
  options.Text("--states", "FILE", arguments.outputs.states,
               "write one state per row of the script, as JSON lines, or as binary if FILE ends in "
               ".bin; -: write JSON to standard output, each row at once",
               ValueKind::kFile);
  options.Text("--fields", "NAME[,NAME...]", arguments.outputs.fields,
               "write only these fields to --states");
  options.Text("--render", "FOLDER", arguments.outputs.pictures,
               "write the X-ray pictures to this folder as PNG files", ValueKind::kFolder);
  options.Group("Replay of a log");
  options.Text("--replay", "LOG", arguments.log,
               "repeat a recorded session and compare every state; exit status 1 if a state "
               "differs or the log is damaged",
               ValueKind::kFile);
  options.Group("Information on scenes");
  options.Text(
      "--explain", "FILE", arguments.explained,
      "print which effects of a scene are on and off, and the time of a tick on this machine",
      ValueKind::kFile);
  options.Text("--check-mesh", "FILE", arguments.surface,
               "check a surface file: report its size and defects, draw a picture, and print the "
               "beginning of a scene; exit status 1 if it does not load",
               ValueKind::kFile);
  options.Text(
      "--picture", "FILE", arguments.picture,
      "output file for the picture of --check-mesh (default: the surface's name with .svg)",
      ValueKind::kFile);
  options.Flag("--list-effects", arguments.list_effects, "list all effects with their roles");
  options.Flag("--list-keys", arguments.list_keys, "list all keys of a scene file");
  options.Flag("--markdown", arguments.markdown, "print --list-keys as Markdown");
  options.Flag("--json-schema", arguments.schema,
               "print all keys of a scene file as a JSON Schema for editors");
}

void Check(const Arguments& arguments) {
  if (arguments.scene.empty()) throw torquer::UsageError("--scene is missing");
  if (arguments.realtime && !(arguments.script.empty() && arguments.log.empty())) {
    throw torquer::UsageError(
        "--realtime is valid only in live sessions; remove it, or remove --script and --replay");
  }
  if (arguments.examination &&
      (arguments.outputs.record.empty() || !arguments.script.empty() || !arguments.log.empty())) {
    throw torquer::UsageError(
        "--examination needs --record in a live session; add --record FILE, or remove it");
  }
  const bool for_script = !arguments.outputs.states.empty() || !arguments.outputs.pictures.empty();
  if (arguments.script.empty() ? for_script : !for_script && arguments.outputs.record.empty()) {
    throw torquer::UsageError(
        "--script needs --states, --render or --record; --states and --render need --script");
  }
  if (!arguments.outputs.fields.empty() && arguments.outputs.states.empty()) {
    throw torquer::UsageError("--fields needs --states");
  }
  if (!arguments.log.empty() && !arguments.outputs.record.empty()) {
    throw torquer::UsageError("--record and --replay exclude each other; remove one of them");
  }
  if (!arguments.log.empty() && !arguments.script.empty()) {
    throw torquer::UsageError("--script and --replay exclude each other; remove one of them");
  }
}

// Uses only torquer.h, as any other program can.
int RunByScript(const Arguments& arguments) {
  const torquer::Scene scene = torquer::Scene::FromFile(arguments.scene);
  Say(scene.findings());
  const AtTheEnd keep([&scene] { return scene.KeepField(); });
  const torquer::program::ScriptResult result = torquer::program::RunScript(
      scene, arguments.script, arguments.outputs, torquer::StopOnSignal());
  if (result.unconverged > 0) {
    torquer::PrintError("torquer-simulator: {} rows ended before equilibrium (see residual)\n",
                        result.unconverged);
  }
  if (result.end == torquer::program::ScriptEnd::kLastRow) return torquer::kExitSuccess;
  const bool stopped = result.end == torquer::program::ScriptEnd::kStopped;
  torquer::PrintError("torquer-simulator: {}; {} of {} rows are done and written\n",
                      stopped ? "asked to stop" : "the reader of standard output has closed it",
                      result.done, result.rows);
  return torquer::kExitFailure;
}

int FollowScript(const Arguments& arguments) {
  try {
    return RunByScript(arguments);
  } catch (const torquer::Error& error) {
    throw torquer::UserError(error.what());
  }
}

int Repeat(torquer::scene::Scene& scene, const std::string& log) {
  const torquer::simulator::ReplayResult result = torquer::simulator::Replay(scene, log);
  fmt::print("{} states repeated, {} differ\n", result.states, result.differing);
  if (result.outlines > 0) {
    fmt::print("{} of them are in the log without their shape; their hashes were compared\n",
               result.outlines);
  }
  if (result.missing > 0) {
    fmt::print("{} states that were not recorded were repeated from later states\n",
               result.missing);
  }
  if (result.differing > 0) fmt::print("the first at tick {}\n", result.first_difference);
  if (!result.ended) {
    fmt::print("the log ends before the simulator did; later states were not compared\n");
  }
  if (result.undecodable > 0) fmt::print("{} messages cannot be decoded\n", result.undecodable);
  if (result.damage.any()) fmt::print("the log is damaged: {}\n", result.damage.Describe());
  return result.Good() ? torquer::kExitSuccess : torquer::kExitFailure;
}

int CheckSurface(const std::string& file, const std::string& picture) {
  const torquer::vessel::MeshCheck check =
      torquer::vessel::CheckMesh(torquer::vessel::ReadMeshContents(file), file);
  fmt::print("{}", torquer::vessel::DescribeCheck(check));
  const std::string drawing = torquer::vessel::DrawCheck(check);
  if (!drawing.empty()) {
    const std::string path = picture.empty() ? file + ".svg" : picture;
    torquer::WriteFileAtomically(path, drawing);
    fmt::print("  picture:      {}\n", torquer::Printable(path, 4096));
  }
  if (!check.surface) return torquer::kExitFailure;
  fmt::print("\nA scene in the same folder may begin with\n\n{}",
             torquer::vessel::ProposeScene(check));
  return torquer::kExitSuccess;
}

int Run(const Arguments& arguments) {
  if (arguments.list_effects) {
    fmt::print("{}", torquer::effects::DescribeEffects());
    return torquer::kExitSuccess;
  }
  if (arguments.list_keys) {
    fmt::print(
        "{}", arguments.markdown ? torquer::scene::KeysAsMarkdown() : torquer::scene::KeysAsText());
    return torquer::kExitSuccess;
  }
  if (arguments.schema) {
    fmt::print("{}", torquer::scene::KeysAsJsonSchema());
    return torquer::kExitSuccess;
  }
  if (!arguments.surface.empty()) return CheckSurface(arguments.surface, arguments.picture);
  if (!arguments.picture.empty()) throw torquer::UsageError("--picture needs --check-mesh");
  if (!arguments.explained.empty()) {
    torquer::scene::Scene scene(arguments.explained);
    const auto keep = KeepField(scene);
    fmt::print("{}", torquer::simulator::Explain(scene));
    return torquer::kExitSuccess;
  }
  Check(arguments);
  if (!arguments.script.empty()) return FollowScript(arguments);
  torquer::scene::Scene scene(arguments.scene);
  Say(scene.vessel().findings);
  const auto keep = KeepField(scene);
  if (!arguments.log.empty()) return Repeat(scene, arguments.log);
  return Live(scene, arguments.url, arguments.outputs.record, arguments.examination,
              arguments.realtime, arguments.json);
}

}  // namespace

int main(int argc, char** argv) {
  torquer::Program program("torquer-simulator",
                           "Simulates guidewires and catheters in the vessel of a scene.");
  Arguments arguments;
  Declare(program.options(), arguments);
  return program.Main(argc, argv, [&] { return Run(arguments); });
}
