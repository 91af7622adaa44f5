// Order in which torquer-viewer sends the settings and the X-ray of an acquisition.
#include <catch2/catch.hpp>
#include <string>
#include <torquer_lcm/imaging_command_t.hpp>
#include <torquer_lcm/instrument_command_t.hpp>
#include <torquer_lcm/wire_state_t.hpp>

#include "protocol/lcm_channels.h"
#include "tests/chain/steering_page.h"
#include "tests/support/daemon_process.h"

namespace torquer::test {
namespace {

TEST_CASE("An acquisition has its settings from its first pulse to its last") {
  Listener listener;
  torquer_lcm::imaging_command_t imaging{};
  bool xray = false;
  int wrong = 0;   // X-ray without the settings of an acquisition
  int begins = 0;  // of X-ray
  int late = 0;    // commands without X-ray, but with the settings of an acquisition
  const auto is_acquisition = [&imaging] {
    return imaging.mode == protocol::kImagingCine && imaging.pulses_per_s == 15;
  };
  listener.bus->Subscribe<torquer_lcm::imaging_command_t>(
      protocol::kImagingCommandChannel, [&](const torquer_lcm::imaging_command_t& message) {
        imaging = message;
        wrong += xray && !is_acquisition();
      });
  listener.bus->Subscribe<torquer_lcm::instrument_command_t>(
      protocol::kInstrumentCommandChannel, [&](const torquer_lcm::instrument_command_t& message) {
        begins += message.xray && !xray;
        xray = message.xray;
        wrong += xray && !is_acquisition();
        late += !xray && is_acquisition();
      });
  const ChildProcess simulator(
      {ProgramPath("torquer-simulator"), "--scene", SourcePath("/host/scenes/ty_phantom.toml")});
  const ChildProcess viewer({ProgramPath("torquer-viewer"), "--steer"});
  REQUIRE(listener.Until([&] { return viewer.Output().find("http://") != std::string::npos; }));
  SteeringPage page(viewer.Output(), 0);
  for (int k = 0; k < 3; ++k) {
    page.Hold(SteeringPage::kAcquisition);
    REQUIRE(listener.Until([&] { return xray && is_acquisition(); }));
    page.Hold(0);
    REQUIRE(listener.Until([&] { return !xray && !is_acquisition(); }));
  }
  CHECK(wrong == 0);
  // The settings go back after one command. Their repetition comes a hundred commands later. A page
  // that a busy machine stops for 300 ms begins more often.
  CHECK(begins >= 3);
  CHECK(late <= begins);
}

}  // namespace
}  // namespace torquer::test
