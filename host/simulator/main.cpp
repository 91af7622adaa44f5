// torquer-simulator: runs a scene live on the bus, from a script, or again from a log.
#include <algorithm>
#include <atomic>
#include <csignal>
#include <cstdio>
#include <nlohmann/json.hpp>
#include <optional>
#include <string>
#include <vector>

#include "host/bus/bus.h"
#include "host/simulator/explain.h"
#include "host/simulator/live_loop.h"
#include "host/simulator/replay.h"
#include "host/simulator/scene/scene.h"
#include "host/simulator/script_run.h"
#include "host/simulator/session.h"
#include "host/simulator/session_record.h"
#include "host/support/program.h"

namespace {

std::atomic<bool> stop{false};

double Quantile(std::vector<float> values, double q) {
  if (values.empty()) return 0;
  const auto k = static_cast<std::size_t>(q * static_cast<double>(values.size() - 1));
  std::nth_element(values.begin(), values.begin() + static_cast<std::ptrdiff_t>(k), values.end());
  return values[k];
}

// What the run has built of the vessel's field is kept for the next one, however this one ends.
struct KeepField {
  const torquer::scene::Scene& scene;
  ~KeepField() {
    const auto& surface = scene.vessel().surface;
    const std::string problem = surface == nullptr ? "" : surface->SaveCache();
    if (!problem.empty()) std::fprintf(stderr, "torquer-simulator: %s\n", problem.c_str());
  }
};

int Live(torquer::scene::Scene& scene, const std::string& url, const std::string& record_file,
         bool json) {
  torquer::bus::Bus bus(url);
  torquer::simulator::Session session(scene);
  std::optional<torquer::simulator::SessionRecord> record;
  if (!record_file.empty()) record.emplace(record_file, session);
  std::signal(SIGINT, [](int) { stop = true; });
  std::signal(SIGTERM, [](int) { stop = true; });
  std::fprintf(stderr, "torquer-simulator: running %s on %s\n", scene.name().c_str(),
               bus.url().c_str());
  const torquer::simulator::LiveStatistics run = torquer::simulator::RunLive(session, bus, stop);
  if (record) record->Finish(session);
  if (json) {
    const nlohmann::json line = {
        {"ticks", run.ticks},
        {"commands", run.commands},
        {"unconverged", run.unconverged},
        {"command_to_state_us_p50", Quantile(run.command_to_state_us, 0.5)},
        {"command_to_state_us_p99", Quantile(run.command_to_state_us, 0.99)},
        {"command_to_state_us_max", Quantile(run.command_to_state_us, 1)},
        {"solve_us_p50", Quantile(run.solve_us, 0.5)},
        {"solve_us_p99", Quantile(run.solve_us, 0.99)},
        {"solve_us_max", Quantile(run.solve_us, 1)}};
    std::printf("%s\n", line.dump().c_str());
  }
  return 0;
}

struct Arguments {
  std::string scene;
  std::string lcm_url;
  std::string script;
  torquer::simulator::ScriptOutputs outputs;
  std::string replay;
  std::string explain;
  bool json = false;
  bool list_effects = false;
};

void Declare(torquer::Options& options, Arguments& arguments) {
  using torquer::ValueKind;
  options.Group("Scene");
  options.Text("--scene", "FILE", arguments.scene, "what to simulate", ValueKind::kFile);
  options.Text("--record", "FILE.json", arguments.outputs.record,
               "at the end write what the observers have found, the assessment among it",
               ValueKind::kFile);
  options.Group("Live");
  options.Text("--lcm-url", "URL", arguments.lcm_url,
               "message bus; without it LCM_DEFAULT_URL, else multicast on this machine");
  options.Flag("--json", arguments.json, "print statistics as one JSON object at the end");
  options.Group("From a script");
  options.Text("--script", "FILE.csv", arguments.script,
               "rows of time_s,insertion_mm,rotation_rad, then if need be "
               "lao_deg,cra_deg,xray,contrast and catheter_insertion_mm,catheter_rotation_rad",
               ValueKind::kFile);
  options.Text("--states", "FILE.jsonl", arguments.outputs.states,
               "write one JSON object for each row", ValueKind::kFile);
  options.Text("--render", "FOLDER", arguments.outputs.pictures, "write X-ray pictures as PNG",
               ValueKind::kFolder);
  options.Group("From a log");
  options.Text("--replay", "FILE.lcmlog", arguments.replay,
               "repeat a recorded session and compare every state", ValueKind::kFile);
  options.Group("Instead of running");
  options.Flag("--list-effects", arguments.list_effects, "list what a scene can call for");
  options.Text("--explain", "FILE", arguments.explain,
               "print what this scene simulates, what is off, and what a tick takes",
               ValueKind::kFile);
}

int Run(Arguments& arguments) {
  const std::string& scene_file = arguments.scene;
  const std::string& script = arguments.script;
  const std::string& log = arguments.replay;
  const std::string& explained = arguments.explain;
  const torquer::simulator::ScriptOutputs& outputs = arguments.outputs;
  const bool list_effects = arguments.list_effects;
  if (list_effects) {
    std::printf("%s", torquer::effects::DescribeEffects(false).c_str());
    return 0;
  }
  if (!explained.empty()) {
    torquer::scene::Scene scene(explained);
    const KeepField keep{scene};
    std::printf("%s", torquer::simulator::Explain(scene).c_str());
    return 0;
  }
  if (scene_file.empty()) throw torquer::UsageError("--scene is missing; name a scene file");
  const bool for_script = !outputs.states.empty() || !outputs.pictures.empty();
  if (script.empty() ? for_script : !for_script && outputs.record.empty()) {
    throw torquer::UsageError("--script and --states, --render or --record go together");
  }
  if (!log.empty() && !outputs.record.empty()) {
    throw torquer::UsageError("--record and --replay exclude each other; give one");
  }
  if (!script.empty() && !log.empty()) {
    throw torquer::UsageError("--script and --replay exclude each other; give one");
  }

  torquer::scene::Scene scene(scene_file);
  for (const std::string& finding : scene.vessel().findings) {
    std::fprintf(stderr, "torquer-simulator: %s\n", finding.c_str());
  }
  const KeepField keep{scene};
  if (!script.empty()) {
    const int unconverged = torquer::simulator::RunScript(scene, script, outputs);
    if (unconverged > 0) {
      std::fprintf(stderr, "torquer-simulator: %d rows ended before equilibrium (see residual)\n",
                   unconverged);
    }
    return 0;
  }
  if (!log.empty()) {
    const torquer::simulator::ReplayResult result = torquer::simulator::Replay(scene, log);
    std::printf("%lld states repeated, %lld differ\n", static_cast<long long>(result.states),
                static_cast<long long>(result.differing));
    if (result.missing > 0) {
      std::printf("%lld that were not recorded were repeated from what later ones tell\n",
                  static_cast<long long>(result.missing));
    }
    if (result.differing == 0) return 0;
    std::printf("the first at tick %lld\n", static_cast<long long>(result.first_difference));
    return 1;
  }
  return Live(scene, arguments.lcm_url, outputs.record, arguments.json);
}

}  // namespace

int main(int argc, char** argv) {
  torquer::Program program(
      "torquer-simulator",
      "Simulates a scene: live, where it follows instrument commands on the bus "
      "and publishes wire states until SIGINT or SIGTERM, from a script, or "
      "again from a log.");
  program.Note(
      "Exit status: 0, or 1 when a replay differs from its log, or 2 when something cannot be "
      "used.");
  Arguments arguments;
  Declare(program.options(), arguments);
  return program.Main(argc, argv, [&] { return Run(arguments); });
}
