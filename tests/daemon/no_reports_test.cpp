// Statistics of a daemon whose device has sent nothing.
#include <catch2/catch.hpp>
#include <csignal>
#include <nlohmann/json.hpp>
#include <string>

#include "tests/daemon/daemon_chain.h"

namespace torquer::test {

TEST_CASE("A daemon without a report knows no latency and no drift of a clock") {
  Listener listener;
  const std::string socket = listener.folder.Path("device");
  SocketDevice device(socket);
  ChildProcess daemon(SocketWords(socket, {"--uncalibrated", "--json"}));
  REQUIRE(device.WaitForHost());
  REQUIRE(listener.UntilHealth("running", "SCRIPTED-1"));
  daemon.Signal(SIGTERM);
  CHECK(daemon.Wait() == 0);
  REQUIRE(listener.UntilHealth("stopping", "asked to stop"));
  CHECK(listener.counters.at("reports_received") == 0);
  CHECK_FALSE(listener.counters.contains("report_to_command_p99_us"));
  CHECK_FALSE(listener.counters.contains("clock_drift_ppm"));
  const auto statistics = nlohmann::json::parse(daemon.Output());
  CHECK(statistics.at("reports_received") == 0);
  for (const char* const name : {"report_to_command_p50_us", "report_to_command_p99_us",
                                 "report_to_command_max_us", "clock_drift_ppm"}) {
    CAPTURE(name);
    CHECK(statistics.at(name).is_null());
  }
}

}  // namespace torquer::test
