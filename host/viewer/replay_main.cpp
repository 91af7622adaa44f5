// torquer-replay: a recorded session in a browser.

#include <fmt/format.h>

#include <cstdio>
#include <optional>
#include <string>
#include <torquer_lcm/scene_description_t.hpp>
#include <utility>

#include "host/bus/message_check.h"
#include "host/simulator/scene/scene.h"
#include "host/support/error.h"
#include "host/support/error_output.h"
#include "host/support/fnv1a.h"
#include "host/support/printable_text.h"
#include "host/support/program.h"
#include "host/support/stop_signal.h"
#include "host/viewer/hash_check.h"
#include "host/viewer/listening_socket.h"
#include "host/viewer/page_token.h"
#include "host/viewer/recording.h"
#include "host/viewer/replay.h"
#include "protocol/lcm_channels.h"

namespace {

namespace viewer = torquer::viewer;

struct Arguments {
  std::string log;
  std::string scene;
  std::uint16_t port = 0;
};

// Scene of the recording: the given one, or the file that the recording names, if it is unchanged.
// Otherwise prints the reason and returns nullopt.
std::optional<torquer::scene::SceneSpec> SceneOf(const viewer::Recording& recording,
                                                 const Arguments& arguments) {
  if (!arguments.scene.empty()) return torquer::scene::ReadScene(arguments.scene);
  for (const auto& topic : recording.topics()) {
    if (topic.channel != torquer::protocol::kSceneChannel) continue;
    torquer_lcm::scene_description_t description;
    const auto bytes = recording.Read(topic, 0);
    if (!torquer::bus::DecodeMessage(bytes.data(), bytes.size(), description)) continue;
    try {
      return torquer::scene::ReadScene(description.scene_file);
    } catch (const torquer::UserError& error) {
      torquer::PrintError("torquer-replay: the vessel is not shown and no state is compared: {}\n",
                          torquer::Printable(error.what(), 400));
    }
  }
  return {};
}

int Run(const Arguments& arguments) {
  const int listening = viewer::ListeningSocket(arguments.port);
  const viewer::Recording recording(arguments.log);
  if (recording.damage().any()) {
    torquer::PrintError("torquer-replay: {}: {}\n", arguments.log, recording.damage().Describe());
  }
  const auto spec = SceneOf(recording, arguments);
  std::optional<torquer::scene::Scene> scene;
  if (spec) scene.emplace(*spec);
  // Loads before signals are caught, because it may take seconds, and Ctrl-C must end it.
  viewer::SceneFrames frames = scene ? viewer::FramesOf(*scene) : viewer::SceneFrames{};
  const viewer::HashCheck::Finding found =
      viewer::RunReplay(recording, arguments.log, listening, viewer::RandomToken(),
                        std::move(frames), scene ? &*scene : nullptr, torquer::StopOnSignal());
  if (!found.error.empty()) throw torquer::UserError(found.error);
  if (scene) {
    fmt::print("{} states repeated{}, {} differ\n", found.result.states,
               found.done ? "" : " until it was stopped", found.result.differing);
  }
  return found.result.differing == 0 && !recording.damage().any() ? torquer::kExitSuccess
                                                                  : torquer::kExitFailure;
}

}  // namespace

int main(int argc, char** argv) {
  torquer::Program program(
      "torquer-replay",
      "Plays a recorded session in a browser on this machine: prints the link of the page and "
      "serves it until SIGINT or SIGTERM. It also repeats the session and compares every state.");
  program.Note(
      "Exit status: 0 when all repeated states are equal; 1 when a state differs or the log is "
      "damaged; 2 when the log cannot be used.");
  Arguments arguments;
  torquer::Options& options = program.options();
  options.Operand("LOG", arguments.log, "log of the session, written by torquer-recorder",
                  torquer::ValueKind::kFile);
  options.Text("--scene", "FILE", arguments.scene,
               "scene file of the session (default: the file that the log names)",
               torquer::ValueKind::kFile);
  options.Integer("--port", "PORT", arguments.port, 0, 65535,
                  "port on 127.0.0.1 that serves the page; 0: any free port");
  return program.Main(argc, argv, [&] { return Run(arguments); });
}
