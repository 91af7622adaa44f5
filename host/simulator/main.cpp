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
#include "host/support/command_line.h"
#include "host/support/error.h"

namespace {

constexpr char kUsage[] =
    "usage: torquer-simulator --scene FILE [--lcm-url URL] [--record FILE.json] [--json]\n"
    "       torquer-simulator --scene FILE --script FILE.csv [--states FILE.jsonl] [--render DIR]\n"
    "                         [--record FILE.json]\n"
    "       torquer-simulator --scene FILE --replay FILE.lcmlog\n"
    "       torquer-simulator --list-effects | --explain FILE\n"
    "Live: follows instrument commands on LCM and publishes wire states, until SIGINT or SIGTERM.\n"
    "--script: header time_s,insertion_mm,rotation_rad, if need be with "
    "lao_deg,cra_deg,xray,contrast\n"
    "and then catheter_insertion_mm,catheter_rotation_rad;\n"
    "one JSON object a row goes to --states, X-ray pictures as PNG to --render.\n"
    "--record: when the session ends, what its observers have found, the assessment among it.\n"
    "--replay: repeats a recorded session and compares every state; exit 1 if one differs.\n"
    "--list-effects: what a scene may call for. --explain: what this one does, and what is off.";

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

int Run(int argc, char** argv) {
  std::string scene_file;
  std::string url;
  std::string script;
  torquer::simulator::ScriptOutputs outputs;
  std::string log;
  std::string explained;
  bool json = false;
  bool list_effects = false;
  torquer::CommandLine line;
  line.Flag("--list-effects", list_effects);
  line.Option("--explain", explained);
  line.Option("--scene", scene_file);
  line.Option("--lcm-url", url);
  line.Option("--script", script);
  line.Option("--states", outputs.states);
  line.Option("--render", outputs.pictures);
  line.Option("--record", outputs.record);
  line.Option("--replay", log);
  line.Flag("--json", json);
  line.Parse(argc, argv, kUsage);
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
  if (scene_file.empty()) throw torquer::UserError(std::string("--scene is missing\n") + kUsage);
  const bool for_script = !outputs.states.empty() || !outputs.pictures.empty();
  if (script.empty() ? for_script : !for_script && outputs.record.empty()) {
    throw torquer::UserError(
        std::string("--script and --states, --render or --record go together\n") + kUsage);
  }
  if (!log.empty() && !outputs.record.empty()) {
    throw torquer::UserError(std::string("--record and --replay exclude each other\n") + kUsage);
  }
  if (!script.empty() && !log.empty()) {
    throw torquer::UserError(std::string("--script and --replay exclude each other\n") + kUsage);
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
  return Live(scene, url, outputs.record, json);
}

}  // namespace

int main(int argc, char** argv) {
  try {
    return Run(argc, argv);
  } catch (const torquer::UserError& error) {
    std::fprintf(stderr, "torquer-simulator: %s\n", error.what());
    return torquer::kExitUserError;
  }
}
