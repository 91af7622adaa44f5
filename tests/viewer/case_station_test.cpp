#include "host/viewer/case_station.h"

#include <catch2/catch.hpp>
#include <chrono>
#include <csignal>
#include <filesystem>
#include <fstream>
#include <nlohmann/json.hpp>
#include <thread>

#include "host/support/error.h"
#include "tests/support/paths.h"
#include "tests/support/temporary_folder.h"

using namespace torquer::viewer;
using torquer::test::TemporaryFolder;
using Phase = CaseStation::Phase;

namespace {

namespace fs = std::filesystem;

constexpr std::int64_t kNow = 1'000'000;

// Stand-ins for the real programs, which record the order of their calls.
class FakePrograms {
 public:
  FakePrograms() {
    Write("torquer-recorder", Waits("recorder", "touch $1\n"));
    Write("torquer-simulator", Waits("simulator"));
    Write("torquer-report", "echo '<h1>done</h1>' >$3; echo report >>" + order_);
  }

  void Write(const std::string& program, const std::string& script) const {
    std::ofstream(folder_.Path(program)) << "#!/bin/sh\n" << script << "\n";
    fs::permissions(folder_.Path(program), fs::perms::owner_all);
  }
  std::string Waits(const std::string& name, const std::string& first = "") const {
    return "trap 'echo " + name + " >>" + order_ + "; exit 0' TERM\n" + first + "echo $$ >" +
           folder_.Path(name + ".pid") + "\nwhile :; do sleep 0.01; done";
  }

  CaseStation Station(const std::string& trainee = "", const std::string& group = "") const {
    std::vector<Case> cases(2);
    cases[0].name = "easy";
    cases[0].file = "easy.toml";
    cases[0].title = "An \"easy\" case";
    cases[1].name = "hard";
    cases[1].file = "hard.toml";
    cases[1].assessed = true;
    cases[1].xray = true;
    return {std::move(cases),
            folder_.Path("sessions"),
            {.folder = folder_.Path(),
             .lcm_url = "",
             .trainee = trainee,
             .group = group,
             .free_bytes = [this] { return free_bytes; }}};
  }

  std::string Read(const std::string& name) const {
    std::ifstream file(folder_.Path(name));
    return {std::istreambuf_iterator<char>(file), {}};
  }
  std::string Order() const { return Read("order"); }
  std::string Path(const std::string& name) const { return folder_.Path(name); }

  std::int64_t free_bytes = CaseStation::kLeastFreeBytes;

 private:
  TemporaryFolder folder_;
  std::string order_ = folder_.Path("order");
};

// Advances the station until `phase`, for at most 5 s of real time; the station's clock stands
// still.
bool Reaches(CaseStation& station, Phase phase, bool sees_states = true) {
  for (int i = 0; i < 5000 && station.phase() != phase; ++i) {
    if (sees_states) station.SawState(kNow);
    station.Advance(kNow);
    std::this_thread::sleep_for(std::chrono::milliseconds(1));
  }
  return station.phase() == phase;
}

// Waits until a program handles signals.
bool Listens(const FakePrograms& fakes, const std::string& program) {
  for (int i = 0; i < 5000 && fakes.Read(program + ".pid").empty(); ++i) {
    std::this_thread::sleep_for(std::chrono::milliseconds(1));
  }
  return !fakes.Read(program + ".pid").empty();
}

nlohmann::json Said(const CaseStation& station) { return nlohmann::json::parse(station.Text()); }

}  // namespace

TEST_CASE("A case runs from its choice to its report, its programs one after the other") {
  const FakePrograms fakes;
  CaseStation station = fakes.Station();
  CHECK(Said(station)["phase"] == "choose");
  CHECK(Said(station)["chosen"] == -1);
  CHECK(Said(station)["cases"][0]["title"] == "An \"easy\" case");
  CHECK(station.chosen() == nullptr);
  CHECK(station.Advance(kNow));  // the first call reports a change
  CHECK_FALSE(station.Advance(kNow));

  REQUIRE(station.Start(1, kNow));
  CHECK(station.phase() == Phase::kStarting);
  CHECK(station.chosen()->name == "hard");
  CHECK_FALSE(station.Start(0, kNow));
  CHECK_FALSE(station.Close());
  REQUIRE(Reaches(station, Phase::kRunning));
  CHECK(fakes.Order().empty());
  CHECK(station.report() == nullptr);

  REQUIRE(Listens(fakes, "simulator"));
  REQUIRE(station.End(kNow));
  CHECK_FALSE(station.End(kNow));
  REQUIRE(Reaches(station, Phase::kEnded));
  CHECK(fakes.Order() == "simulator\nrecorder\nreport\n");
  REQUIRE(station.report() != nullptr);
  CHECK(*station.report() == "<h1>done</h1>\n");
  CHECK(Said(station)["problem"] == "");
  CHECK(Said(station)["report"] == true);
  const std::string folder = Said(station)["folder"];
  CHECK(fs::exists(folder + "/session.lcmlog"));
  CHECK(folder.starts_with(fakes.Path("sessions/hard/2")));

  REQUIRE(station.Close());
  CHECK(station.phase() == Phase::kChoose);
  CHECK(station.report() == nullptr);
  // A second start within the same second uses another folder.
  REQUIRE(station.Start(1, kNow));
  CHECK(station.runs() == 2);
  CHECK(Said(station)["folder"] != folder);
}

TEST_CASE("A report names the trainee and the group") {
  const FakePrograms fakes;
  fakes.Write("torquer-report", "echo \"$*\" >" + fakes.Path("words") + "; echo done >$3");
  CaseStation station = fakes.Station("Ann Smith", "2026");
  REQUIRE(station.Start(0, kNow));
  REQUIRE(Reaches(station, Phase::kRunning));
  REQUIRE(Listens(fakes, "simulator"));
  REQUIRE(station.End(kNow));
  REQUIRE(Reaches(station, Phase::kEnded));
  CHECK_THAT(fakes.Read("words"), Catch::Contains("--trainee=Ann Smith --group=2026"));
}

TEST_CASE("An examination is noted by the programs that write its record and its report") {
  const FakePrograms fakes;
  fakes.Write("torquer-simulator",
              fakes.Waits("simulator", "echo \"$@\" >" + fakes.Path("simulator.words") + "\n"));
  fakes.Write("torquer-report", "echo \"$@\" >" + fakes.Path("report.words") + "\necho done >$3");
  CaseStation station = fakes.Station();
  // The easy case has no X-ray, so it cannot be an examination.
  CHECK_FALSE(station.Start(0, kNow, true));
  CHECK(station.phase() == Phase::kChoose);
  CHECK(Said(station)["examination"] == false);
  for (const bool examination : {true, false}) {
    REQUIRE(station.Start(1, kNow, examination));
    CHECK(Said(station)["examination"] == examination);
    REQUIRE(Reaches(station, Phase::kRunning));
    REQUIRE(Listens(fakes, "simulator"));
    REQUIRE(station.End(kNow));
    REQUIRE(Reaches(station, Phase::kEnded));
    for (const char* words : {"simulator.words", "report.words"}) {
      INFO(words);
      const bool noted = fakes.Read(words).find("--examination") != std::string::npos;
      CHECK(noted == examination);
    }
    fs::remove(fakes.Path("simulator.pid"));
  }
}

TEST_CASE("States count only once the case's own simulator runs") {
  const FakePrograms fakes;
  fakes.Write("torquer-recorder", fakes.Waits("recorder"));  // no log yet, so no simulator
  CaseStation station = fakes.Station();
  REQUIRE(station.Start(0, kNow));
  for (int i = 0; i < 20; ++i) {
    station.Advance(kNow);
    station.SawState(kNow);
    std::this_thread::sleep_for(std::chrono::milliseconds(1));
  }
  CHECK(station.phase() == Phase::kStarting);
  REQUIRE(Listens(fakes, "recorder"));
  REQUIRE(station.End(kNow));
  CHECK(Reaches(station, Phase::kEnded));
  CHECK(fakes.Order() == "recorder\n");  // without a log there is no report
}

TEST_CASE("A failure of a case is reported, and another case can be started") {
  const FakePrograms fakes;
  CaseStation station = fakes.Station();
  SECTION("no such case") { CHECK_FALSE(station.Start(2, kNow)); }
  SECTION("its simulator ends") {
    fakes.Write("torquer-simulator", "echo first; echo the scene is broken >&2; exit 2");
    REQUIRE(station.Start(0, kNow));
    REQUIRE(Reaches(station, Phase::kEnded, false));
    CHECK(Said(station)["problem"] ==
          "torquer-simulator has ended too early, with status 2: the scene is broken");
    CHECK(station.report() != nullptr);  // covers the recording up to the end
  }
  SECTION("its simulator is killed") {
    fakes.Write("torquer-simulator", "kill -KILL $$");
    REQUIRE(station.Start(0, kNow));
    REQUIRE(Reaches(station, Phase::kEnded, false));
    CHECK(Said(station)["problem"] == "torquer-simulator has ended too early, killed by signal 9");
  }
  SECTION("its recorder ends") {
    fakes.Write("torquer-recorder", "echo the disk is full; exit 2");
    REQUIRE(station.Start(0, kNow));
    REQUIRE(Reaches(station, Phase::kEnded, false));
    CHECK(Said(station)["problem"] ==
          "torquer-recorder has ended too early, with status 2: the disk is full");
    CHECK(station.report() == nullptr);
  }
  SECTION("no report") {
    fakes.Write("torquer-report", "echo nothing to judge; exit 2");
    REQUIRE(station.Start(0, kNow));
    REQUIRE(Reaches(station, Phase::kRunning));
    REQUIRE(station.End(kNow));
    REQUIRE(Reaches(station, Phase::kEnded));
    CHECK(Said(station)["problem"] ==
          "torquer-report has ended too early, with status 2: nothing to judge");
    CHECK(station.report() == nullptr);
  }
  SECTION("a program is missing") {
    fs::remove(fakes.Path("torquer-recorder"));
    REQUIRE(station.Start(0, kNow));
    CHECK(station.phase() == Phase::kEnded);
    CHECK(Said(station)["problem"].get<std::string>().find("torquer-recorder: cannot be started") !=
          std::string::npos);
  }
  SECTION("its simulator ignores a request to end") {
    fakes.Write("torquer-simulator", "trap '' TERM; echo $$ >" + fakes.Path("simulator.pid") +
                                         "; while :; do sleep 0.01; done");
    REQUIRE(station.Start(0, kNow));
    REQUIRE(Reaches(station, Phase::kRunning));
    REQUIRE(Listens(fakes, "simulator"));
    REQUIRE(station.End(kNow));
    std::this_thread::sleep_for(std::chrono::milliseconds(100));
    station.Advance(kNow + 9'000'000);
    CHECK(station.phase() == Phase::kEnding);
    station.Advance(kNow + 11'000'000);
    CHECK(Reaches(station, Phase::kEnded));
    CHECK(fakes.Order() == "recorder\nreport\n");
  }
  fakes.Write("torquer-recorder", fakes.Waits("x", "touch $1\n"));
  fakes.Write("torquer-simulator", fakes.Waits("x"));
  fakes.Write("torquer-report", "exit 2");
  REQUIRE(station.Start(1, kNow));
  CHECK(Reaches(station, Phase::kRunning));
  CHECK(Said(station)["problem"] == "");
}

TEST_CASE("An open case does not fill the disk") {
  FakePrograms fakes;
  CaseStation station = fakes.Station();
  const auto says_why = [&station] {
    return Said(station)["problem"].get<std::string>().find(
               "sessions: 2.0 GB are free there, and a session needs 2; remove old sessions") !=
           std::string::npos;
  };
  REQUIRE(station.Start(0, kNow));
  REQUIRE(Reaches(station, Phase::kRunning));
  REQUIRE(Listens(fakes, "simulator"));
  fakes.free_bytes -= 1;
  station.Advance(kNow + 1'000'000);
  CHECK(station.phase() == Phase::kRunning);  // the last check was a moment ago
  station.Advance(kNow + 3'000'000);
  CHECK(station.phase() == Phase::kEnding);
  CHECK(Reaches(station, Phase::kEnded));
  CHECK(says_why());
  CHECK(station.report() != nullptr);
  CHECK(station.Start(0, kNow));
  CHECK(station.phase() == Phase::kEnded);
  CHECK(says_why());
  CHECK(station.runs() == 2);
  fakes.free_bytes += 1;
  CHECK(station.Start(0, kNow));
  CHECK(station.phase() == Phase::kStarting);
}

TEST_CASE("No case starts beside a stranger's simulator") {
  const FakePrograms fakes;
  CaseStation station = fakes.Station();
  station.SawState(kNow);
  REQUIRE(station.Start(0, kNow + 200'000));
  CHECK(station.phase() == Phase::kEnded);
  CHECK_THAT(std::string(Said(station)["problem"]),
             Catch::Contains("another torquer-simulator") && Catch::Contains("--lcm-url"));
  REQUIRE(station.Close());
  // The stranger's simulator is gone.
  REQUIRE(station.Start(0, kNow + 500'000));
  CHECK(station.phase() == Phase::kStarting);
}

TEST_CASE("A station that ends takes its programs with it, and writes the report") {
  const FakePrograms fakes;
  {
    CaseStation station = fakes.Station();
    REQUIRE(station.Start(0, kNow));
    REQUIRE(Reaches(station, Phase::kRunning));
    REQUIRE(Listens(fakes, "simulator"));
  }
  CHECK(fakes.Order() == "simulator\nrecorder\nreport\n");
}

TEST_CASE("Cases are a folder's scenes with a section [case], the easiest first") {
  const TemporaryFolder folder;
  const fs::path scenes = torquer::test::SourcePath("/host/scenes");
  std::vector<std::string> problems;
  CHECK_THROWS_WITH(ReadCases(folder.Path("none"), problems),
                    Catch::Contains("none: cannot be read: No such file"));
  CHECK_THROWS_WITH(ReadCases(folder.Path(), problems),
                    Catch::Contains("has no scene with a section [case]; write one"));

  const auto copy = [&](const std::string& name, const std::string& as, int difficulty,
                        const std::string& title) {
    std::ifstream from(scenes / (name + ".toml"));
    std::string text{std::istreambuf_iterator<char>(from), {}};
    const auto begin = text.find("[case]");
    const auto end = text.find("[vessel]");
    const std::string described =
        "[case]\ntitle = \"" + title +
        "\"\ntask = \"Push.\"\ndifficulty = " + std::to_string(difficulty) + "\n\n";
    text.replace(begin, end - begin, title.empty() ? "" : described);
    std::ofstream(folder.Path(as + ".toml")) << text;
  };
  copy("calcified", "b", 4, "Later");
  copy("calcified", "a", 4, "Sooner");
  copy("ty_phantom", "z", 1, "First");
  copy("ty_phantom", "none", 1, "");
  std::ofstream(folder.Path("broken.toml")) << "name = 3\n";
  std::ofstream(folder.Path("notes.md")) << "no scene\n";
  fs::create_directory(folder.Path("pictures"));
  std::ofstream(folder.Path("pictures/b.jpg")) << "picture";
  const std::vector<Case> cases = ReadCases(folder.Path(), problems);
  REQUIRE(cases.size() == 3);
  CHECK(cases[0].name == "z");
  CHECK(cases[1].title == "Later");
  CHECK(cases[1].picture == "picture");
  CHECK(cases[2].title == "Sooner");
  CHECK(cases[2].picture.empty());
  CHECK(cases[2].task == "Push.");
  CHECK(cases[2].instruments == std::vector<std::string>{"guidewire"});
  CHECK_FALSE(cases[2].xray);
  REQUIRE(problems.size() == 1);
  CHECK_THAT(problems[0], Catch::Contains("broken.toml"));
}
