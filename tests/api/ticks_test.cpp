// Tests of torquer.h: observing a step while it runs, and reading wall contacts, pictures and
// records.
#include <torquer/torquer.h>

#include <algorithm>
#include <catch2/catch.hpp>
#include <cmath>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <nlohmann/json.hpp>
#include <stdexcept>
#include <string>
#include <vector>

#include "tests/support/child_process.h"
#include "tests/support/paths.h"
#include "tests/support/sanitizer.h"
#include "tests/support/scenes.h"
#include "tests/support/temporary_folder.h"

namespace {

using Catch::Contains;
using torquer::Command;
using torquer::Imaging;
using torquer::Scene;
using torquer::Simulation;
using torquer::StepReport;
using torquer::test::SceneFile;

// With a heartbeat, ticks end every 5 ms.
constexpr char kBeating[] =
    "[effects.heartbeat]\namplitude_mm = 3\ndirection = [0.3, 0, 1]\n"
    "[[effects.heartbeat.region]]\ncenter_mm = [140, 0, 0]\nradius_mm = 50\n";
constexpr char kXray[] =
    "[effects.fluoroscopy]\nwidth_px = 96\nheight_px = 64\nphotons = 1e6\nbody_width_mm = 0\n";

// A push by 5.25 mm in 52.5 ms, from the start.
Command Push(const Simulation& simulation) {
  Command command = simulation.command();
  command.time_s = 0.0525;
  command.hands[0].insertion_mm += 5.25;
  command.xray = true;
  command.lao_deg = 20;
  return command;
}

double ReadingOf(const Simulation& simulation, const std::string& name) {
  for (const torquer::Reading& reading : simulation.readings()) {
    if (reading.name == name) return reading.value;
  }
  return -1;
}

/// Sets an environment variable for the lifetime of this object.
class Environment {
 public:
  Environment(const char* name, const std::string& value) : name_(name) {
    if (const char* const before = std::getenv(name)) before_ = before;
    setenv(name, value.c_str(), 1);
  }
  ~Environment() {
    if (before_.empty()) {
      unsetenv(name_);
    } else {
      setenv(name_, before_.c_str(), 1);
    }
  }
  Environment(const Environment&) = delete;
  Environment& operator=(const Environment&) = delete;

 private:
  const char* const name_;
  std::string before_;
};

std::vector<std::filesystem::path> FieldsIn(const std::string& folder) {
  std::vector<std::filesystem::path> fields;
  if (!std::filesystem::exists(folder)) return fields;
  for (const auto& entry : std::filesystem::directory_iterator(folder)) {
    if (entry.path().extension() == ".field") fields.push_back(entry.path());
  }
  return fields;
}

}  // namespace

TEST_CASE("A step takes ticks of the scene's length while the vessel moves", "[api]") {
  const auto ticks = [](const std::string& keys) {
    const SceneFile file("linear_density_g_m = 0.7\n" + std::string(kBeating) + keys);
    Simulation simulation(Scene::FromFile(file.path()));
    return simulation.Step(Push(simulation)).ticks;
  };
  CHECK(ticks("") == 11);
  CHECK(ticks("[relaxation]\nlongest_tick_ms = 20\n") == 3);
  CHECK(ticks("[relaxation]\nlongest_tick_ms = 2\n") == 27);
  // Inertia needs the ticks of a live session.
  CHECK(ticks("[effects.inertia]\n[relaxation]\nlongest_tick_ms = 20\n") == 53);
}

TEST_CASE("A step of more than an hour has ticks of an hour, so that it can be ended", "[api]") {
  const SceneFile file;
  Simulation simulation(Scene::FromFile(file.path()));
  Command command = simulation.command();
  command.time_s = 3600;
  command.hands[0].insertion_mm += 1;
  CHECK(simulation.Step(command).ticks == 1);
  command.time_s += 2.5 * 3600;
  command.hands[0].insertion_mm += 1;
  std::vector<double> ends_s;
  simulation.Step(command, [&](const StepReport&) {
    ends_s.push_back(simulation.time_s());
    return true;
  });
  CHECK(ends_s == std::vector<double>{7200, 10'800, 12'600});
  // An hour across a full hour is not divided.
  command.time_s += 3600;
  CHECK(simulation.Step(command).ticks == 1);
  command.time_s = 1e9;
  const StepReport report =
      simulation.Step(command, [&](const StepReport&) { return simulation.time_s() < 20'000; });
  CHECK_FALSE(report.finished);
  CHECK(simulation.time_s() == 21'600);
}

TEST_CASE("A step calls back for each tick, with the same result as without a callback", "[api]") {
  const SceneFile file(std::string(torquer::test::kFriction) + kBeating);
  const Scene scene = Scene::FromFile(file.path());
  Simulation simulation(scene);
  Simulation untold(scene);
  const Command start = simulation.command();
  std::vector<double> times_s;
  StepReport sum;
  const StepReport report = simulation.Step(Push(simulation), [&](const StepReport& tick) {
    times_s.push_back(simulation.time_s());
    CHECK(tick.ticks == 1);
    CHECK(tick.finished);
    CHECK(simulation.command().time_s == simulation.time_s());
    CHECK(simulation.command().hands[0].insertion_mm ==
          Approx(start.hands[0].insertion_mm + 100 * simulation.time_s()));
    sum.iterations += tick.iterations;
    sum.work += tick.work;
    sum.converged = tick.converged;
    return true;
  });
  const std::vector<double> expected_s = {0.005, 0.010, 0.015, 0.020, 0.025, 0.030,
                                          0.035, 0.040, 0.045, 0.050, 0.0525};
  REQUIRE(times_s.size() == expected_s.size());
  for (std::size_t k = 0; k < times_s.size(); ++k) CHECK(times_s[k] == Approx(expected_s[k]));
  CHECK(report.ticks == 11);
  CHECK(report.finished);
  CHECK(report.iterations == sum.iterations);
  CHECK(report.work == sum.work);
  CHECK(report.converged == sum.converged);
  untold.Step(Push(untold));
  CHECK(simulation.state_hash() == untold.state_hash());
}

TEST_CASE("An interrupted step continues at its position", "[api]") {
  const SceneFile file(std::string(torquer::test::kFriction) + kBeating);
  const Scene scene = Scene::FromFile(file.path());
  Simulation simulation(scene);
  const Command wanted = Push(simulation);
  int ticks = 0;
  const bool thrown = GENERATE(false, true);
  const auto end = [&](const StepReport&) {
    if (++ticks < 3) return true;
    if (thrown) throw std::runtime_error("enough");
    return false;
  };
  if (thrown) {
    CHECK_THROWS_WITH(simulation.Step(wanted, end), "enough");
  } else {
    const StepReport report = simulation.Step(wanted, end);
    CHECK_FALSE(report.finished);
    CHECK(report.ticks == 3);
  }
  const Command reached = simulation.command();
  CHECK(simulation.time_s() == Approx(0.015));
  CHECK(reached.time_s == simulation.time_s());
  CHECK(reached.hands[0].insertion_mm == Approx(120 + 1.5));
  CHECK(reached.xray);
  CHECK(reached.lao_deg == 20);
  // A simulation whose step ended at this time must give the same.
  Simulation other(scene);
  other.Step(reached);
  CHECK(other.state_hash() == simulation.state_hash());
  other.Step(wanted);
  CHECK(simulation.Step(wanted).ticks == 8);
  CHECK(other.state_hash() == simulation.state_hash());
}

TEST_CASE("A step that is ended in its last tick is finished", "[api]") {
  const SceneFile file;
  const Scene scene = Scene::FromFile(file.path());
  Simulation simulation(scene);
  const StepReport report =
      simulation.Step(Push(simulation), [](const StepReport&) { return false; });
  CHECK(report.ticks == 1);  // no effect depends on time
  CHECK(report.finished);
}

TEST_CASE("Each picture can be taken when it is due", "[api]") {
  const SceneFile file(std::string(kBeating) + kXray + "pictures_per_s = 20\n");
  const Scene scene = Scene::FromFile(file.path());
  Simulation simulation(scene);
  CHECK_FALSE(simulation.picture_due());
  Command command = Push(simulation);
  command.time_s = 0.5;
  std::vector<double> taken_s;
  Simulation later(scene);
  simulation.Step(command, [&](const StepReport&) {
    if (!simulation.picture_due()) return true;
    const torquer::Picture& picture = simulation.LastPicture();
    CHECK(picture.gray.size() == 96 * 64);
    CHECK(picture.lao_deg == Approx(20));
    taken_s.push_back(picture.time_s);
    CHECK_FALSE(simulation.picture_due());
    return true;
  });
  CHECK(static_cast<double>(taken_s.size()) == ReadingOf(simulation, "xray_pulses"));
  REQUIRE(taken_s.size() >= 9);
  REQUIRE(taken_s.size() <= 11);
  for (std::size_t k = 1; k < taken_s.size(); ++k) {
    CHECK(taken_s[k] - taken_s[k - 1] == Approx(0.05).margin(0.005));
  }
  // A caller that asks only after the step gets its last picture.
  later.Step(command);
  CHECK(later.picture_due());
  CHECK(later.LastPicture().time_s == taken_s.back());
  CHECK(later.LastPicture().gray == simulation.LastPicture().gray);
  CHECK_FALSE(later.picture_due());
  CHECK_FALSE(later.picture_due(-1));
  CHECK_FALSE(later.picture_due(1));
}

TEST_CASE("Settings of the X-ray system change pictures and dose", "[api]") {
  const SceneFile file("attenuation_1_mm = 3\n" + std::string(kXray) +
                       "isocenter_mm = [80, 0, 0]\n");
  const Scene scene = Scene::FromFile(file.path());
  const auto run = [&](const Imaging& imaging) {
    Simulation simulation(scene);
    Command command = simulation.command();
    for (int k = 1; k <= 100; ++k) {
      command.time_s = 0.01 * k;
      command.xray = true;
      command.imaging = imaging;
      simulation.Step(command);
    }
    return simulation;
  };
  const Simulation plain = run({});
  const double kerma_mGy = ReadingOf(plain, "air_kerma_mGy");
  REQUIRE(kerma_mGy > 0);
  // Half the field width at equal brightness takes four times the dose.
  const Simulation magnified = run({.magnification = 2});
  CHECK(ReadingOf(magnified, "air_kerma_mGy") == Approx(4 * kerma_mGy));
  CHECK(magnified.state_hash() == plain.state_hash());
  CHECK(ReadingOf(run({.pulses_per_s = 5}), "xray_pulses") == 5);
  // Pixels behind the shutters are black.
  Simulation covered = run({.left = 0.25, .right = 0.125, .top = 0.5 / 4, .bottom = 0.25});
  const torquer::Picture& picture = covered.LastPicture();
  int wrong = 0;
  for (int row = 0; row < 64; ++row) {
    for (int column = 0; column < 96; ++column) {
      const bool open = column >= 24 && column < 84 && row >= 8 && row < 48;
      wrong += open != (picture.gray[static_cast<std::size_t>(96 * row + column)] > 0) ? 1 : 0;
    }
  }
  CHECK(wrong == 0);
  // In subtraction mode a wire at rest cancels with the mask and is invisible.
  const auto contrast = [](Simulation simulation) {
    const std::vector<std::uint8_t>& gray = simulation.LastPicture().gray;
    const auto [low, high] = std::minmax_element(gray.begin(), gray.end());
    return *high - *low;
  };
  CHECK(contrast(plain) > 8);
  CHECK(contrast(run({.mode = Imaging::Mode::kSubtraction})) <= 3);
}

TEST_CASE("Contacts have the places and depths of the wire in the wall", "[api]") {
  const SceneFile file;
  const Scene scene = Scene::FromFile(file.path());
  Simulation simulation(scene);
  Command command = simulation.command();
  for (int k = 1; k <= 20; ++k) {
    command.time_s = 0.1 * k;
    command.hands[0].insertion_mm += 2;
    simulation.Step(command);
  }
  const std::vector<torquer::Contact> contacts = simulation.contacts();
  REQUIRE(contacts.size() >= 2);
  const double* const nodes_mm = simulation.nodes_mm();
  // Largest penetration of a segment in mm, sampled at 101 points along it.
  const auto deepest = [&](std::size_t node) {
    double most_mm = -1;
    for (int k = 0; k <= 100; ++k) {
      torquer::Point point{};
      for (std::size_t axis = 0; axis < 3; ++axis) {
        point[axis] =
            std::lerp(nodes_mm[3 * (node - 1) + axis], nodes_mm[3 * node + axis], k / 100.);
      }
      most_mm = std::max(most_mm, 0.2 - scene.ClearanceMm(point));
    }
    return most_mm;
  };
  double most_mm = 0;
  for (std::size_t k = 0; k < contacts.size(); ++k) {
    INFO("node " << contacts[k].node);
    REQUIRE(contacts[k].node >= 1);
    REQUIRE(contacts[k].node < simulation.node_count());
    if (k > 0) CHECK(contacts[k].node > contacts[k - 1].node);
    CHECK(contacts[k].penetration_mm > 0);
    // A segment has fewer contact points than samples, so its penetration may be smaller.
    CHECK(contacts[k].penetration_mm <= deepest(contacts[k].node) + 1e-6);
    CHECK(contacts[k].penetration_mm > 0.5 * deepest(contacts[k].node));
    most_mm = std::max(most_mm, contacts[k].penetration_mm);
  }
  CHECK(most_mm == Approx(simulation.max_penetration_mm()));
  // No other segment is in the wall.
  std::size_t in_the_wall = 0;
  for (std::size_t node = 1; node < simulation.node_count(); ++node) {
    in_the_wall += deepest(node) > 1e-3 ? 1 : 0;
  }
  CHECK(contacts.size() >= in_the_wall);
}

TEST_CASE("Friction alone dissipates", "[api]") {
  const bool rough = GENERATE(false, true);
  const SceneFile file(rough ? torquer::test::kFriction : "");
  const Scene scene = Scene::FromFile(file.path());
  Simulation simulation(scene);
  Command command = simulation.command();
  command.time_s = 1;
  command.hands[0].insertion_mm += 20;
  simulation.Step(command);
  CHECK(simulation.energy_mJ() > 0);
  CHECK((simulation.dissipated_mJ() > 0) == rough);
  if (!rough) CHECK(simulation.dissipated_mJ() == 0);
}

TEST_CASE("A program and torquer-simulator write the same record", "[api]") {
  const SceneFile file(
      "[effects.wall_force]\nthreshold_mN = 0.5\n[effects.assessment]\ntarget_centerline = "
      "\"main\"\ntarget_at_mm = 200\nforce_limit_mN = 1\n");
  const Scene scene = Scene::FromFile(file.path());
  CHECK(scene.path() == file.path());
  CHECK(Scene::FromText(scene.text(), scene.folder()).path() == "scene");
  Simulation simulation(scene);
  Command command = simulation.command();
  std::ofstream rows(file.Beside("s.csv"));
  rows << "time_s,guidewire.insertion_mm\n";
  for (int k = 0; k <= 5; ++k) {
    command.time_s = k;
    command.hands[0].insertion_mm = 120 + 3 * k;
    simulation.Step(command);
    rows << k << ',' << 3 * k << '\n';
  }
  rows.close();
  torquer::test::ChildProcess run({torquer::test::ProgramPath("torquer-simulator"), "--scene",
                                   file.path(), "--script", file.Beside("s.csv"), "--record",
                                   file.Beside("r.json")});
  REQUIRE(run.Wait() == 0);
  std::ifstream in(file.Beside("r.json"));
  CHECK(simulation.Record() == std::string(std::istreambuf_iterator<char>(in), {}));
  const nlohmann::json record = nlohmann::json::parse(simulation.Record());
  CHECK(record["scene_file"] == file.path());
  CHECK(record["ticks"] == 6);
  CHECK(record["simulated_s"] == 5);
  CHECK(record["instruments"]["guidewire"]["insertion_mm"] == 135);
  REQUIRE(record["readings"].size() == simulation.readings().size());
  for (const torquer::Reading& reading : simulation.readings()) {
    INFO(reading.name);
    // JSON has null for a value that is not known.
    const nlohmann::json expected = nlohmann::json::parse(nlohmann::json(reading.value).dump());
    CHECK(record["readings"][reading.name] == expected);
  }
  // A scene without observers has an empty list of readings.
  const SceneFile unobserved;
  const Simulation bare(Scene::FromFile(unobserved.path()));
  CHECK(nlohmann::json::parse(bare.Record())["readings"] == nlohmann::json::object());
}

TEST_CASE("Built parts of a field are kept on request", "[api]") {
  const torquer::test::TemporaryFolder folder;
  const std::string scene_file = torquer::test::SourcePath("/host/scenes/neuro_arch.toml");
  {
    const Environment cache("XDG_CACHE_HOME", folder.Path());
    const Scene scene = Scene::FromFile(scene_file);
    Simulation simulation(scene);
    CHECK(FieldsIn(folder.Path("torquer")).empty());
    CHECK(scene.KeepField().empty());
    const auto fields = FieldsIn(folder.Path("torquer"));
    REQUIRE(fields.size() == 1);
    // The field is written again only after it has grown.
    std::filesystem::remove(fields[0]);
    CHECK(scene.KeepField().empty());
    CHECK(FieldsIn(folder.Path("torquer")).empty());
    Command command = simulation.command();
    command.time_s = 1;
    command.hands[0].insertion_mm += torquer::test::Rounds(60, 3);
    simulation.Step(command);
    CHECK(scene.KeepField().empty());
    CHECK(FieldsIn(folder.Path("torquer")).size() == 1);
  }
  std::ofstream(folder.Path("file")) << "x";
  const Environment cache("XDG_CACHE_HOME", folder.Path("file"));
  const Scene scene = Scene::FromFile(scene_file);
  const Simulation simulation(scene);
  CHECK_THAT(scene.KeepField(), Contains("file/torquer"));
  // A vessel of tubes has no field to keep.
  const SceneFile tubes;
  CHECK(Scene::FromFile(tubes.path()).KeepField().empty());
}
