// Where host/demo writes, and what it removes. The programs are stand-ins that end at once, so that
// every session fails as soon as its folder is there.

#include <sys/stat.h>
#include <sys/wait.h>

#include <catch2/catch.hpp>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <map>
#include <string>
#include <vector>

#include "tests/support/file_contents.h"
#include "tests/support/paths.h"
#include "tests/support/private_network.h"
#include "tests/support/temporary_folder.h"

using torquer::test::Contents;
using torquer::test::TemporaryFolder;
namespace fs = std::filesystem;

namespace {

constexpr char kList[] = ".torquer-demo-files";

void Write(const std::string& path, const std::string& text) {
  std::ofstream(path, std::ios::binary) << text;
}

// A folder of stand-ins for the programs, and one for the sessions.
struct Bench {
  TemporaryFolder folder;

  Bench() {
    fs::create_directories(folder.Path("bin"));
    fs::create_directories(folder.Path("sessions"));
    Program("torquer-recorder", "trap exit TERM; : >\"$1\"; while :; do sleep 0.1; done");
    Program("torquer-simulator", "echo torquer-simulator: gone; exit 1");
  }
  void Program(const std::string& name, const std::string& does) const {
    Write(folder.Path("bin/" + name), "#!/bin/sh\n" + does + "\n");
    chmod(folder.Path("bin/" + name).c_str(), 0755);
  }

  int Run(const std::string& more = "") const {
    const std::string command = "bash " + torquer::test::SourcePath("/host/demo") +
                                " --scene ty_phantom --programs " + folder.Path("bin") +
                                " --files " + Session("") + " " + more + " >" + folder.Path("out") +
                                " 2>" + folder.Path("err");
    const int status = std::system(command.c_str());
    return WIFEXITED(status) ? WEXITSTATUS(status) : -1;
  }
  std::string Session(const std::string& name) const { return folder.Path("sessions/" + name); }
  std::string Error() const { return Contents(folder.Path("err")); }

  // Those that the demo made.
  std::vector<std::string> Sessions() const {
    std::vector<std::string> names;
    for (const auto& entry : fs::directory_iterator(Session(""))) {
      if (!entry.is_symlink() && fs::exists(entry.path() / kList)) {
        names.push_back(entry.path().filename());
      }
    }
    return names;
  }
};

// What stands in a folder of a user who works there.
std::map<std::string, std::string> UsersFiles(const Bench& bench) {
  std::map<std::string, std::string> files;
  for (const char* name : {"notes.csv", "wire.svg", "session.lcmlog", "a.log", "record.json",
                           ".lock", "20200101-000000/wire.svg", "20200101-000001.csv"}) {
    files[bench.Session(name)] = std::string("mine: ") + name;
  }
  fs::create_directory(bench.Session("20200101-000000"));
  for (const auto& [path, text] : files) Write(path, text);
  return files;
}

void CheckAreThere(const std::map<std::string, std::string>& files) {
  for (const auto& [path, text] : files) {
    INFO(path);
    CHECK(Contents(path) == text);
  }
}

}  // namespace

TEST_CASE("A demo writes into its own folder, and removes what it made and nothing else") {
  torquer::test::NeedPrivateNetwork();
  const Bench bench;
  const auto users = UsersFiles(bench);
  REQUIRE(bench.Run() == 2);
  CHECK_THAT(bench.Error(), Catch::Contains("torquer-simulator: gone"));
  REQUIRE(bench.Sessions().size() == 1);
  const std::string first = bench.Sessions()[0];
  CHECK(fs::read_symlink(bench.Session("latest")) == first);
  CHECK(fs::exists(bench.Session("latest/simulator.log")));
  CheckAreThere(users);

  // A file that the user put beside the session's own stays, and so does its folder.
  Write(bench.Session(first + "/notes.txt"), "mine");
  REQUIRE(bench.Run("--keep 1") == 2);
  CHECK_THAT(bench.Error(), Catch::Contains(first + " has files that are not of the demo"));
  REQUIRE(bench.Sessions().size() == 1);
  const std::string second = bench.Sessions()[0];
  CHECK(second != first);
  CHECK(Contents(bench.Session(first + "/notes.txt")) == "mine");
  CHECK_FALSE(fs::exists(bench.Session(first + "/simulator.log")));
  CHECK(fs::read_symlink(bench.Session("latest")) == second);

  // A list that names what is not in its folder removes nothing there.
  Write(bench.Session(second + "/" + kList), "../notes.csv\n" + bench.Session("a.log") + "\n*\n");
  // A folder behind a link is not the demo's, whatever is in it.
  fs::create_directory(bench.folder.Path("elsewhere"));
  Write(bench.folder.Path("elsewhere/wire.svg"), "mine");
  Write(bench.folder.Path("elsewhere/") + kList, "wire.svg\n");
  fs::create_directory_symlink(bench.folder.Path("elsewhere"), bench.Session("20200101-000003"));
  // Nor is a link `latest` that leads elsewhere.
  fs::remove(bench.Session("latest"));
  fs::create_directory_symlink(bench.folder.Path("elsewhere"), bench.Session("latest"));
  REQUIRE(bench.Run("--keep 1") == 2);
  CHECK(Contents(bench.folder.Path("elsewhere/wire.svg")) == "mine");
  CHECK(fs::read_symlink(bench.Session("latest")) == bench.folder.Path("elsewhere"));
  CHECK_THAT(bench.Error(), Catch::Contains("latest is not a link of the demo"));
  CHECK(bench.Sessions().size() == 1);
  CheckAreThere(users);

  CHECK(bench.Run("--duration 9999999999") == 2);
  CHECK_THAT(bench.Error(),
             Catch::Contains("takes up to 80000000042 MB") && Catch::Contains("free"));
  CHECK(bench.Sessions().size() == 1);
  CHECK(bench.Run("--keep 0") == 2);
  CHECK_THAT(bench.Error(), Catch::Contains("--keep 0: give a number of sessions"));
}
