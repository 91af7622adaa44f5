// Files that host/demo writes and removes. Stand-ins for the programs exit at once, so every
// session fails as soon as its folder exists.

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

// One folder of stand-ins for the programs, and one for the sessions.
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

  // Session folders that the demo created.
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

// Typical files in the folder of a user.
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

TEST_CASE("A demo writes into its own folder, and removes only its own files") {
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

  // A session folder stays if the user added a file to it, and so does that file.
  Write(bench.Session(first + "/notes.txt"), "mine");
  REQUIRE(bench.Run("--keep 1") == 2);
  CHECK_THAT(bench.Error(), Catch::Contains(first + " has files that the demo did not write"));
  REQUIRE(bench.Sessions().size() == 1);
  const std::string second = bench.Sessions()[0];
  CHECK(second != first);
  CHECK(Contents(bench.Session(first + "/notes.txt")) == "mine");
  CHECK_FALSE(fs::exists(bench.Session(first + "/simulator.log")));
  CHECK(fs::read_symlink(bench.Session("latest")) == second);

  // Entries that name files outside the session's folder must not remove them.
  Write(bench.Session(second + "/" + kList), "../notes.csv\n" + bench.Session("a.log") + "\n*\n");
  // The demo does not own a folder behind a link, whatever the folder contains.
  fs::create_directory(bench.folder.Path("elsewhere"));
  Write(bench.folder.Path("elsewhere/wire.svg"), "mine");
  Write(bench.folder.Path("elsewhere/") + kList, "wire.svg\n");
  fs::create_directory_symlink(bench.folder.Path("elsewhere"), bench.Session("20200101-000003"));
  // The same holds for a link `latest` that leads elsewhere.
  fs::remove(bench.Session("latest"));
  fs::create_directory_symlink(bench.folder.Path("elsewhere"), bench.Session("latest"));
  REQUIRE(bench.Run("--keep 1") == 2);
  CHECK(Contents(bench.folder.Path("elsewhere/wire.svg")) == "mine");
  CHECK(fs::read_symlink(bench.Session("latest")) == bench.folder.Path("elsewhere"));
  CHECK_THAT(bench.Error(), Catch::Contains("latest is not a link that the demo made"));
  CHECK(bench.Sessions().size() == 1);
  CheckAreThere(users);

  CHECK(bench.Run("--duration 9999999999") == 2);
  CHECK_THAT(bench.Error(),
             Catch::Contains("takes up to 80000000042 MB") && Catch::Contains("free"));
  CHECK(bench.Sessions().size() == 1);
  CHECK(bench.Run("--keep 0") == 2);
  CHECK_THAT(bench.Error(), Catch::Contains("--keep 0: give a number of sessions"));
}
