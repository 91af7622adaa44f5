// torquer-viewer: the session on the bus, in a browser.

#include <fmt/format.h>

#include <algorithm>
#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "host/bus/bus.h"
#include "host/simulator/scene/scene.h"
#include "host/support/error.h"
#include "host/support/error_output.h"
#include "host/support/nearest_name.h"
#include "host/support/program.h"
#include "host/support/stop_signal.h"
#include "host/viewer/listening_socket.h"
#include "host/viewer/page_token.h"
#include "host/viewer/sole_hand.h"
#include "host/viewer/viewer.h"

namespace {

struct Arguments {
  std::string url;
  std::string scene;
  std::string cases;
  std::string start;
  std::string sessions;
  std::string trainee;
  std::string group;
  std::string token_file;
  std::uint16_t port = 0;
  bool steer = false;
};

namespace viewer = torquer::viewer;

int NumberOf(const std::vector<viewer::Case>& cases, const std::string& name) {
  if (name.empty()) return -1;
  std::vector<std::string> names;
  for (const viewer::Case& one : cases) names.push_back(one.name);
  const auto found = std::find(names.begin(), names.end(), name);
  if (found != names.end()) return static_cast<int>(found - names.begin());
  const std::string near = torquer::NearestName(name, names);
  throw torquer::UserError(fmt::format("--start {}: there is no such case; {}there are: {}", name,
                                       near.empty() ? "" : fmt::format("did you mean {}? ", near),
                                       fmt::join(names, ", ")));
}

std::vector<viewer::Case> CasesOf(const std::string& folder) {
  std::vector<std::string> problems;
  std::vector<viewer::Case> cases = viewer::ReadCases(folder, problems);
  for (const std::string& problem : problems) {
    torquer::PrintError("torquer-viewer: {}\n", problem);
  }
  return cases;
}

void Check(const Arguments& arguments) {
  if (!arguments.cases.empty() && !arguments.scene.empty()) {
    throw torquer::UsageError("--cases and --scene exclude each other");
  }
  if (arguments.cases.empty() != arguments.sessions.empty()) {
    throw torquer::UsageError("--cases and --sessions go together");
  }
  if (arguments.cases.empty() && !arguments.start.empty()) {
    throw torquer::UsageError("--start is for --cases");
  }
  if (arguments.cases.empty() && !arguments.trainee.empty()) {
    throw torquer::UsageError("--trainee is for --cases");
  }
  if (arguments.trainee.empty() && !arguments.group.empty()) {
    throw torquer::UsageError("--group " + arguments.group + ": name the trainee by --trainee");
  }
}

int Run(const Arguments& arguments) {
  Check(arguments);
  // The socket comes first, because it depends on no other part.
  const int listening = viewer::ListeningSocket(arguments.port);
  const std::string token = arguments.token_file.empty() ? viewer::RandomToken()
                                                         : viewer::KeptToken(arguments.token_file);
  torquer::bus::Bus bus(arguments.url);
  std::optional<viewer::SoleHand> sole;
  if (arguments.steer) sole.emplace(bus.url());
  std::optional<torquer::scene::Scene> scene;
  if (!arguments.scene.empty()) scene.emplace(arguments.scene);
  std::optional<viewer::CaseStation> station;
  viewer::ViewerSetup setup;
  setup.steer = arguments.steer;
  // Loads before signals are caught, because it may take seconds, and Ctrl-C must end it.
  if (scene) setup.frames = viewer::FramesOf(*scene);
  if (!arguments.cases.empty()) {
    std::vector<viewer::Case> cases = CasesOf(arguments.cases);
    setup.start = NumberOf(cases, arguments.start);
    const viewer::CaseStation::Programs programs{
        .folder = std::filesystem::read_symlink("/proc/self/exe").parent_path(),
        .lcm_url = arguments.url,
        .trainee = arguments.trainee,
        .group = arguments.group};
    station.emplace(std::move(cases), arguments.sessions, programs);
    setup.station = &*station;
  }
  viewer::RunViewer(bus, listening, token, setup, torquer::StopOnSignal());
  return torquer::kExitSuccess;
}

}  // namespace

int main(int argc, char** argv) {
  torquer::Program program("torquer-viewer",
                           "Shows the session on the bus in a browser on this machine: prints the "
                           "link of the page and serves it until SIGINT or SIGTERM.");
  program.Note(
      "A listening socket replaces --port if it is passed in by systemd's convention (LISTEN_PID, "
      "LISTEN_FDS=1).");
  Arguments arguments;
  torquer::Options& options = program.options();
  options.Text("--scene", "FILE", arguments.scene,
               "scene, by file or name, with the vessel of the 3D view", torquer::ValueKind::kFile);
  options.Text(
      "--cases", "FOLDER", arguments.cases,
      "folder of scenes, instead of --scene; the page starts the scene that the user chooses",
      torquer::ValueKind::kFolder);
  options.Text("--start", "CASE", arguments.start, "case of --cases that starts at once");
  options.Text("--sessions", "FOLDER", arguments.sessions,
               "output folder for the logs, records and reports of --cases",
               torquer::ValueKind::kFolder);
  options.Text("--trainee", "NAME", arguments.trainee,
               "name of the trainee, for the reports of --cases");
  options.Text("--group", "NAME", arguments.group, "group of the trainee, such as a course");
  options.Flag("--steer", arguments.steer,
               "let the page's keys command the instruments, instead of bench devices");
  options.Integer("--port", "PORT", arguments.port, 0, 65535,
                  "port on 127.0.0.1 that serves the page; 0: any free port");
  options.Text("--token-file", "FILE", arguments.token_file,
               "file that keeps the secret part of the link for the next start",
               torquer::ValueKind::kFile);
  options.Text(
      "--lcm-url", "URL", arguments.url,
      "URL of the message bus; without it LCM_DEFAULT_URL, or else multicast on this machine");
  return program.Main(argc, argv, [&] { return Run(arguments); });
}
