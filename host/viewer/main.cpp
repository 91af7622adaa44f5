// torquer-viewer: the session on the bus, in a browser.

#include <cstdint>
#include <optional>
#include <string>

#include "host/bus/bus.h"
#include "host/simulator/scene/scene.h"
#include "host/support/program.h"
#include "host/support/stop_signal.h"
#include "host/viewer/listening_socket.h"
#include "host/viewer/page_token.h"
#include "host/viewer/viewer.h"

namespace {

struct Arguments {
  std::string url;
  std::string scene;
  std::string token_file;
  std::uint16_t port = 0;
  bool steer = false;
};

int Run(const Arguments& arguments) {
  namespace viewer = torquer::viewer;
  // The socket first: it is all that needs nothing else.
  const int listening = viewer::ListeningSocket(arguments.port);
  const std::string token = arguments.token_file.empty() ? viewer::RandomToken()
                                                         : viewer::KeptToken(arguments.token_file);
  torquer::bus::Bus bus(arguments.url);
  std::optional<torquer::scene::Scene> scene;
  if (!arguments.scene.empty()) scene.emplace(arguments.scene);
  viewer::RunViewer(bus, listening, token, scene ? &*scene : nullptr, arguments.steer,
                    torquer::StopOnSignal());
  return torquer::kExitSuccess;
}

}  // namespace

int main(int argc, char** argv) {
  torquer::Program program(
      "torquer-viewer",
      "Shows the session that is on the bus in a browser of this machine: prints the link of the "
      "page and serves it until SIGINT or SIGTERM.");
  program.Note(
      "A listening socket that systemd's convention passes in (LISTEN_PID, LISTEN_FDS=1) is served "
      "instead of --port.");
  Arguments arguments;
  torquer::Options& options = program.options();
  options.Text("--scene", "FILE", arguments.scene, "the scene, for the vessel in the 3D view",
               torquer::ValueKind::kFile);
  options.Flag("--steer", arguments.steer,
               "the page's keys command the instruments, in place of bench devices");
  options.Integer("--port", "PORT", arguments.port, 0, 65535,
                  "of 127.0.0.1, where the page is served; 0 takes a free one");
  options.Text("--token-file", "FILE", arguments.token_file,
               "keeps the secret part of the link for the next start", torquer::ValueKind::kFile);
  options.Text("--lcm-url", "URL", arguments.url,
               "message bus; without it LCM_DEFAULT_URL, else multicast on this machine");
  return program.Main(argc, argv, [&] { return Run(arguments); });
}
