#include "host/simulator/session.h"

#include <catch2/catch.hpp>
#include <cmath>
#include <limits>

#include "protocol/lcm_channels.h"
#include "tests/simulator/scenes.h"

using torquer::CountedBudget;
using torquer::simulator::Command;
using torquer::simulator::Session;
using torquer::test::SceneFile;

namespace {

Command To(double insertion_mm, double rotation_rad = 0) {
  Command command;
  command.sequence = 7;
  command.target = {insertion_mm, rotation_rad};
  return command;
}

}  // namespace

TEST_CASE("A session follows its commands and restarts as it began", "[simulator]") {
  const SceneFile file(torquer::test::kFriction);
  torquer::scene::Scene scene(file.path());
  Session session(scene);
  const std::uint64_t first = session.state_hash();
  CHECK(session.state().insertion_mm == 120);
  CountedBudget budget(1000);
  session.Tick(To(123.37, 0.5), budget);
  CHECK(session.state().insertion_mm == 123.37);
  CHECK(session.state().rotation_rad == 0.5);
  CHECK((session.status() & torquer::protocol::kWireConverged) != 0);
  const std::uint64_t moved = session.state_hash();
  CHECK(moved != first);
  session.Restart();
  CHECK(session.state_hash() == first);
  CountedBudget again(1000);
  session.Tick(To(123.37, 0.5), again);
  CHECK(session.state_hash() == moved);
}

TEST_CASE("A target that is not a number is refused and the last one stands", "[simulator]") {
  const SceneFile file;
  torquer::scene::Scene scene(file.path());
  Session session(scene);
  const double bad[] = {std::numeric_limits<double>::quiet_NaN(),
                        std::numeric_limits<double>::infinity(), 1e9};
  for (const double value : bad) {
    CountedBudget budget(1000);
    session.Tick(To(value), budget);
    CHECK((session.status() & torquer::protocol::kWireInputRefused) != 0);
    CHECK(session.state().insertion_mm == 120);
    CountedBudget more(1000);
    session.Tick(To(120, value), more);
    CHECK((session.status() & torquer::protocol::kWireInputRefused) != 0);
    CHECK(session.state().nodes.back().allFinite());
  }
  CountedBudget budget(1000);
  session.Tick(To(121), budget);
  CHECK((session.status() & torquer::protocol::kWireInputRefused) == 0);
  CHECK(session.state().insertion_mm == 121);
}

TEST_CASE("A message carries nodes whose arc length is the insertion", "[simulator]") {
  const std::string method = GENERATE(std::string(""), std::string(torquer::test::kPaperMethod));
  const SceneFile file(method);
  torquer::scene::Scene scene(file.path());
  Session session(scene);
  CountedBudget budget(500);
  session.Tick(To(130.4), budget);
  torquer_lcm::wire_state_t message;
  session.Describe(message);
  REQUIRE(message.node_count == message.segment_count + 1);
  double length = 0;
  for (std::size_t i = 1; i < message.nodes_mm.size(); ++i) {
    double squared = 0;
    for (std::size_t a = 0; a < 3; ++a) {
      squared += std::pow(message.nodes_mm[i][a] - message.nodes_mm[i - 1][a], 2);
    }
    length += std::sqrt(squared);
  }
  CHECK(length + message.carried_mm == Approx(130.4).margin(1e-3));
  CHECK(message.commanded_insertion_mm == 130.4);
  CHECK(message.command_sequence == 7);
  CHECK(message.contact_count > 0);
  CHECK(message.contact_nodes.size() == message.contact_penetrations_um.size());
  CHECK(static_cast<std::uint64_t>(message.state_hash) == session.state_hash());
  // The paper's method feeds whole segments only.
  if (!method.empty()) CHECK(message.carried_mm == Approx(0.4));
}

TEST_CASE("A long wire is sent with a stride, its tip always", "[simulator]") {
  const SceneFile file;
  std::string text;
  {
    std::ifstream in(file.path());
    text.assign(std::istreambuf_iterator<char>(in), {});
  }
  const auto at = text.find("segment_mm = 1\n");
  text.replace(at, 15, "segment_mm = 0.05\n");
  std::ofstream(file.path()) << text;
  torquer::scene::Scene scene(file.path());
  Session session(scene);
  CountedBudget budget(3000);
  session.Tick(To(130), budget);
  torquer_lcm::wire_state_t message;
  session.Describe(message);
  CHECK(message.segment_count > torquer::simulator::kMostNodesInMessage);
  CHECK(message.stride == 2);
  CHECK(message.nodes_mm.back()[0] == Approx(message.tip_mm[0]));
  CHECK(message.getEncodedSize() < 65499);
}
