#include "host/simulator/simulation.h"

#include <catch2/catch.hpp>
#include <cmath>
#include <limits>

#include "protocol/lcm_channels.h"
#include "tests/support/scenes.h"

using torquer::CountedBudget;
using torquer::InstrumentPoses;
using torquer::simulator::Command;
using torquer::simulator::Simulation;
using torquer::test::SceneFile;

namespace {

constexpr char kFineSegments[] = "[relaxation]\nsegment_mm = 0.05\n";

Command To(double insertion_mm, double rotation_rad = 0) {
  Command command;
  command.target = InstrumentPoses(insertion_mm, rotation_rad);
  return command;
}

// `message`: a wire_state_t or an instrument_state_t.
template <class Message>
double ArcLength(const Message& message) {
  double length_mm = 0;
  for (std::size_t i = 1; i < message.nodes_mm.size(); ++i) {
    double squared = 0;
    for (std::size_t axis = 0; axis < 3; ++axis) {
      squared += std::pow(message.nodes_mm[i][axis] - message.nodes_mm[i - 1][axis], 2);
    }
    length_mm += std::sqrt(squared);
  }
  return length_mm;
}

}  // namespace

TEST_CASE("A simulation follows its commands and restarts as it began", "[simulator]") {
  const SceneFile file(torquer::test::kFriction);
  torquer::scene::Scene scene(file.path());
  Simulation simulation(scene);
  const std::uint64_t first = simulation.state_hash();
  CHECK(simulation.state().insertion_mm() == 120);
  CountedBudget budget(1000);
  simulation.Tick(To(123.37, 0.5), budget);
  CHECK(simulation.state().insertion_mm() == 123.37);
  CHECK(simulation.state().rotation_rad() == 0.5);
  CHECK((simulation.status() & torquer::protocol::kWireConverged) != 0);
  const std::uint64_t moved = simulation.state_hash();
  CHECK(moved != first);
  simulation.Restart();
  CHECK(simulation.state_hash() == first);
  CountedBudget again(1000);
  simulation.Tick(To(123.37, 0.5), again);
  CHECK(simulation.state_hash() == moved);
}

TEST_CASE("A withdrawn straight wire becomes one with a long bend", "[simulator]") {
  namespace scene = torquer::scene;
  const auto wire = [](double tip_mm, double tip_angle_deg) {
    return scene::With(scene::ParseScene(torquer::test::SceneText(), "small.toml", "."),
                       {{"instrument.guidewire.inserted_at_start_mm", 0.0},
                        {"instrument.guidewire.tip_mm", tip_mm},
                        {"instrument.guidewire.tip_angle_deg", tip_angle_deg}});
  };
  scene::Scene straight(wire(0, 0));
  scene::Scene bent(wire(60, 200));
  CountedBudget budget(100000);
  Simulation before(straight);
  before.Tick(To(30), budget);
  CHECK_THROWS_WITH(before.CheckExchange(0), Catch::Contains("inserted by 30 mm"));
  // A hand that has come back before its wire.
  CountedBudget none(0);
  before.Tick(To(0, 0.5), none);
  CHECK_THROWS_WITH(before.CheckExchange(0), Catch::Contains("its hand at 0 mm"));
  before.Tick(To(0, 0.5), budget);
  // A hand that is ahead of its wire.
  before.Tick(To(3, 0.5), none);
  CHECK_THROWS_WITH(before.CheckExchange(0), Catch::Contains("its hand at 3 mm"));
  before.Tick(To(0, 0.5), budget);
  before.CheckExchange(0);
  Simulation exchanged(bent, before);
  CHECK(exchanged.time_s() == before.time_s());
  Simulation fresh(bent);
  for (Simulation* const one : {&exchanged, &fresh}) {
    one->Tick(To(0, 0.5), budget);
    one->Tick(To(90, 0.5), budget);
    CHECK(one->report().converged);
  }
  CHECK((exchanged.state().tip() - fresh.state().tip()).norm() < 1e-3);
  // Room for all joints that rest curved.
  CHECK(exchanged.state().reference_twist().size() == fresh.state().reference_twist().size());
}

TEST_CASE("A feed is relaxed in parts of the scene's longest feed", "[simulator]") {
  const auto parts = [](const std::string& keys, const std::string& segment_mm = "1") {
    const SceneFile file("[relaxation]\nsegment_mm = " + segment_mm + "\n" + keys);
    torquer::scene::Scene scene(file.path());
    Simulation simulation(scene);
    Command command;
    command.target = simulation.target();
    command.target[0].insertion_mm += 2;
    CountedBudget budget(10000);
    const torquer::TickReport report = simulation.Tick(command, budget);
    CHECK(report.converged);
    return report.actions;
  };
  CHECK(parts("") == 8);
  CHECK(parts("longest_feed_mm = 0.125\n") == 16);
  CHECK(parts("longest_feed_mm = 0.5\n") == 4);
  // Half a segment is the limit, or 0.25 mm if that is more.
  CHECK(parts("longest_feed_mm = 2\n") == 4);
  CHECK(parts("", "0.2") == 8);
  CHECK(parts("longest_feed_mm = 0.125\n", "0.2") == 16);
  CHECK(parts("longest_feed_mm = 2\n", "0.2") == 8);
}

TEST_CASE("A target that is not a number is refused and the last one stays", "[simulator]") {
  const SceneFile file;
  torquer::scene::Scene scene(file.path());
  Simulation simulation(scene);
  const double bad[] = {std::numeric_limits<double>::quiet_NaN(),
                        std::numeric_limits<double>::infinity(), 1e9};
  for (const double value : bad) {
    CountedBudget budget(1000);
    simulation.Tick(To(value), budget);
    CHECK((simulation.status() & torquer::protocol::kWireInputRefused) != 0);
    CHECK(simulation.state().insertion_mm() == 120);
    CountedBudget more(1000);
    simulation.Tick(To(120, value), more);
    CHECK((simulation.status() & torquer::protocol::kWireInputRefused) != 0);
    CHECK(simulation.state().nodes().back().allFinite());
  }
  CountedBudget budget(1000);
  simulation.Tick(To(121), budget);
  CHECK((simulation.status() & torquer::protocol::kWireInputRefused) == 0);
  CHECK(simulation.state().insertion_mm() == 121);
}

TEST_CASE("A message carries nodes whose arc length is the insertion", "[simulator]") {
  const std::string method = GENERATE(std::string(""), std::string(torquer::test::kPaperMethod));
  const SceneFile file(method);
  torquer::scene::Scene scene(file.path());
  Simulation simulation(scene);
  CountedBudget budget(500);
  simulation.Tick(To(130.4), budget);
  torquer_lcm::wire_state_t message;
  simulation.Describe(message);
  REQUIRE(message.node_count == message.segment_count + 1);
  REQUIRE(message.instrument_count == 1);
  REQUIRE(message.instruments.size() == 1);
  const torquer_lcm::instrument_state_t& wire = message.instruments[0];
  CHECK(wire.name == "guidewire");
  CHECK(ArcLength(message) + wire.carried_mm == Approx(130.4).margin(1e-3));
  CHECK(wire.insertion_mm + wire.carried_mm == Approx(130.4));
  CHECK(wire.commanded_insertion_mm == 130.4);
  CHECK(message.contact_count > 0);
  CHECK(message.contact_nodes.size() == message.contact_penetrations_um.size());
  CHECK(static_cast<std::uint64_t>(message.state_hash) == simulation.state_hash());
  // The paper's method feeds whole segments only.
  if (!method.empty()) CHECK(wire.carried_mm == Approx(0.4));
}

TEST_CASE("Nodes and carried motion make up the command however little is inserted",
          "[simulator]") {
  const SceneFile file;
  torquer::scene::Scene scene(file.path());
  Simulation simulation(scene);
  for (const double insertion_mm : {3.1, 1.2, 0.6, 0.3, 0.01, 0.0}) {
    CountedBudget budget(10000);
    simulation.Tick(To(insertion_mm), budget);
    torquer_lcm::wire_state_t message;
    simulation.Describe(message);
    INFO(insertion_mm);
    CHECK(ArcLength(message) + message.instruments[0].carried_mm ==
          Approx(insertion_mm).margin(1e-4));
  }
}

TEST_CASE("An instrument has nodes in the message if it lies on another curve", "[simulator]") {
  const std::string kind = GENERATE(as<std::string>(), "stack", "room", "buddy", "fine buddy");
  const std::string more =
      kind == "stack" ? torquer::test::kMicrocatheter
      : kind == "room"
          ? std::string(torquer::test::kMicrocatheter) + "[effects.clearance]\n"
          : std::string(torquer::test::kBuddyWire) + (kind == "buddy" ? "" : kFineSegments);
  const SceneFile file(more);
  torquer::scene::Scene scene(file.path());
  const Simulation simulation(scene);
  torquer_lcm::wire_state_t message;
  // A message is filled again and again.
  for (int time = 0; time < 2; ++time) simulation.Describe(message);
  INFO(kind);
  REQUIRE(message.instruments.size() == 2);
  CHECK(message.instruments[0].node_count == 0);
  const torquer_lcm::instrument_state_t& second = message.instruments[1];
  CHECK(static_cast<std::size_t>(second.node_count) == second.nodes_mm.size());
  CHECK(second.nodes_mm.empty() == (kind == "stack"));
  CHECK(message.getEncodedSize() < 65499);
  if (kind == "stack") return;
  CHECK(second.node_count <= torquer::simulator::kMostOwnNodesInMessage + 1);
  // A stride shortens a bent polyline.
  CHECK(ArcLength(second) ==
        Approx(second.insertion_mm).margin(kind == "fine buddy" ? 0.01 : 1e-3));
  const auto apart_mm = [&](std::size_t axis) {
    return static_cast<double>(second.nodes_mm[0][axis] - message.nodes_mm[0][axis]);
  };
  const double from_main_mm = std::hypot(apart_mm(0), apart_mm(1), apart_mm(2));
  CHECK(from_main_mm == Approx(kind == "room" ? 0 : 1).margin(1e-5));
  for (std::size_t axis = 0; axis < 3; ++axis) {
    CHECK(second.nodes_mm.back()[axis] == Approx(second.tip_mm[axis]).margin(1e-5));
  }
}

TEST_CASE("The status shows an instrument outside the lumen on any curve", "[simulator]") {
  const double rigidity_N_mm2 = GENERATE(0.01, 100.);
  const SceneFile file(
      "[[instrument]]\nname = \"buddy\"\nmax_length_mm = 200\nradius_mm = 0.2\n"
      "inserted_at_start_mm = 110\nrigidity_N_mm2 = " +
      std::to_string(rigidity_N_mm2) +
      "\n[instrument.entry]\ncenterline = \"main\"\nat_mm = 1\noffset_mm = [0.6, -0.8]\n");
  torquer::scene::Scene scene(file.path());
  Simulation simulation(scene);
  CountedBudget budget(1000);
  Command command;
  command.target = simulation.target();
  simulation.Tick(command, budget);
  const bool outside = (simulation.status() & torquer::protocol::kWireOutsideLumen) != 0;
  CHECK(outside == (rigidity_N_mm2 > 1));
}

TEST_CASE("A long wire is sent with a stride, its tip always", "[simulator]") {
  const SceneFile file(kFineSegments);
  torquer::scene::Scene scene(file.path());
  Simulation simulation(scene);
  CountedBudget budget(3000);
  simulation.Tick(To(130), budget);
  torquer_lcm::wire_state_t message;
  simulation.Describe(message);
  CHECK(message.segment_count > torquer::simulator::kMostNodesInMessage);
  CHECK(message.stride == 2);
  for (int axis = 0; axis < 3; ++axis) {
    CHECK(message.nodes_mm.back()[static_cast<std::size_t>(axis)] ==
          Approx(message.instruments[0].tip_mm[axis]));
  }
  CHECK(message.getEncodedSize() < 65499);
}
