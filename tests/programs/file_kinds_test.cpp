// Special files: no program may read one, because it could wait forever for a writer. No program
// may replace one, because a device must stay a device. The table covers programs and options,
// times the kinds of files at a path.
#include <sys/stat.h>
#include <sys/sysmacros.h>

#include <catch2/catch.hpp>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <sstream>
#include <string>
#include <vector>

#include "tests/programs/every_program.h"
#include "tests/support/child_process.h"
#include "tests/support/file_contents.h"
#include "tests/support/paths.h"
#include "tests/support/scenes.h"

using Catch::Contains;
using torquer::test::ChildProcess;
using torquer::test::Contents;
using torquer::test::Words;
namespace fs = std::filesystem;

namespace {

// Kind of file at a path, and its name in messages.
struct Kind {
  std::string name;
  std::string said;
};
const std::vector<Kind> kKinds = {{"pipe", "it is a pipe"},
                                  {"folder", "it is a folder"},
                                  {"device", "it is a device"},
                                  {"link-to-pipe", "it is a pipe"},
                                  {"link-to-device", "it is a device"}};

// A folder with one of each kind, a scene, and scenes that name each of them.
struct Bench {
  torquer::test::SceneFile scene{"[effects.wall_force]\nthreshold_mN = 20\n"};

  Bench() {
    REQUIRE(mkfifo(Path("pipe").c_str(), 0600) == 0);
    fs::create_directory(Path("folder"));
    // The test's own device node: with a real one, a mistake would replace it for the whole
    // machine.
    if (mknod(Path("device").c_str(), S_IFCHR | 0666, makedev(1, 3)) == 0) {
      fs::create_symlink("device", Path("link-to-device"));
    }
    fs::create_symlink("pipe", Path("link-to-pipe"));
    std::ofstream(Path("script.csv")) << "time_s,guidewire.insertion_mm\n0,0\n0.001,0.1\n";
    for (const Kind& kind : kKinds) {
      // The extension selects a surface's format.
      fs::create_symlink(kind.name, Path(kind.name + ".obj"));
      std::ofstream(Path("surface-" + kind.name + ".toml"))
          << "name = \"x\"\n[vessel]\nkind = \"surface\"\nfile = \"" << kind.name
          << ".obj\"\nmesh_unit = \"mm\"\nvoxel_mm = 2\nwall_stiffness_N_mm2 = 1\n[entry]\n"
          << "point_mm = [0, 0, 0]\ndirection = [0, 0, 1]\n[[instrument]]\n"
          << "name = \"guidewire\"\nmax_length_mm = 200\nradius_mm = 0.2\n"
          << "rigidity_N_mm2 = 6e-3\n";
    }
  }

  std::string Path(const std::string& name) const { return scene.Beside(name); }
};

// Checks that `words` is refused for each kind of file. In `words`, @ stands for the path, KIND for
// its name, SCENE and SCRIPT for valid files. The result is the same for each kind.
void CheckRefused(const Bench& bench, const Words& words) {
  for (const Kind& kind : kKinds) {
    const std::string path = bench.Path(kind.name);
    if (!fs::exists(path)) continue;  // only root can create a device node
    Words command{"/usr/bin/timeout", "60"};
    std::string line;
    for (std::string word : words) {
      const auto replace = [&word](const std::string& from, const std::string& to) {
        if (const auto at = word.find(from); at != std::string::npos) {
          word.replace(at, from.size(), to);
        }
      };
      replace("KIND", kind.name);
      replace("@", path);
      if (word == "SCENE") word = bench.scene.path();
      if (word == "SCRIPT") word = bench.Path("script.csv");
      if (word == "OUT") word = bench.Path("out");
      if (word.starts_with("torquer-")) word = torquer::test::ProgramPath(word);
      if (word.starts_with("surface-")) word = bench.Path(word);
      command.push_back(word);
      line += word + " ";
    }
    INFO(line);
    const auto type = fs::symlink_status(path).type();
    ChildProcess process(command);
    CHECK(process.Wait() == 2);
    CHECK_THAT(process.Error(), Contains(kind.said));
    CHECK_THAT(process.Error(), Contains(path) || Contains(kind.name));
    CHECK(fs::symlink_status(path).type() == type);
    CHECK_FALSE(fs::exists(bench.Path("out")));
  }
}

void WriteLongScript(const std::string& path) {
  std::ofstream script(path);
  script << "time_s,guidewire.insertion_mm\n";
  for (int row = 0; row < 1000; ++row) script << 0.001 * row << ',' << 0.01 * row << '\n';
}

void CheckRowsAreWhole(const std::string& path) {
  const std::string text = Contents(path);
  std::istringstream lines(text);
  for (std::string line; std::getline(lines, line);) {
    REQUIRE((line.starts_with('{') && line.ends_with('}')));
  }
  CHECK((text.empty() || text.back() == '\n'));
}

}  // namespace

TEST_CASE("A path that is not an ordinary file is not read, and no program waits for it",
          "[programs]") {
  const Bench bench;
  const std::vector<Words> inputs = {
      {"torquer-simulator", "--scene", "@", "--script", "SCRIPT", "--states", "OUT"},
      {"torquer-simulator", "--explain", "@"},
      {"torquer-simulator", "--scene", "SCENE", "--script", "@", "--states", "OUT"},
      {"torquer-simulator", "--scene", "SCENE", "--replay", "@"},
      {"torquer-simulator", "--explain", "surface-KIND.toml"},
      {"torquer-simulator", "--check-mesh", "@"},
      {"torquer-report", "@"},
      {"torquer-clip", "@", "clip.mp4"},
      {"torquer-replay", "@"},
      {"torquer-daemon", "--source", "socket", "--calibration", "@"},
      {"torquer-emulator", "--motion", "@"},
      {"torquer-emulator", "--eeprom", "@"},
      {"torquer-checksum-image", "@", "OUT"},
  };
  for (const Words& words : inputs) CheckRefused(bench, words);
}

TEST_CASE("A path that is not an ordinary file is not written to, and stays unchanged",
          "[programs]") {
  const Bench bench;
  const std::vector<Words> outputs = {
      {"torquer-simulator", "--scene", "SCENE", "--script", "SCRIPT", "--states", "@"},
      {"torquer-simulator", "--scene", "SCENE", "--script", "SCRIPT", "--record", "@"},
      {"torquer-report", "SCRIPT", "--picture", "@"},
      {"torquer-emulator", "--eeprom", "@"},
  };
  for (const Words& words : outputs) CheckRefused(bench, words);

  // A write through a link to an ordinary file is allowed.
  std::ofstream(bench.Path("file")) << "old";
  fs::create_symlink("file", bench.Path("link"));
  ChildProcess process({torquer::test::ProgramPath("torquer-simulator"), "--scene",
                        bench.scene.path(), "--script", bench.Path("script.csv"), "--states",
                        bench.Path("link")});
  CHECK(process.Wait() == 0);
  CHECK(fs::is_symlink(bench.Path("link")));
  CHECK_THAT(Contents(bench.Path("file")), Contains("nodes_mm"));
}

TEST_CASE("An output that can never be written is refused before anything is computed",
          "[programs]") {
  const Bench bench;
  for (const std::string& path :
       {bench.Path(std::string(300, 'x')), bench.Path("no/such/folder/file"), bench.Path("")}) {
    for (const char* option : {"--states", "--record"}) {
      INFO(option << " " << path);
      ChildProcess process({torquer::test::ProgramPath("torquer-simulator"), "--scene",
                            bench.scene.path(), "--script", bench.Path("script.csv"), option,
                            path});
      CHECK(process.Wait() == 2);
      CHECK_THAT(process.Error(), Contains("cannot be written"));
    }
  }
}

TEST_CASE("A disk that fills up ends a script, and the rows before are kept", "[programs]") {
  const Bench bench;
  WriteLongScript(bench.Path("script.csv"));
  std::ofstream(bench.Path("states")) << "old";
  ChildProcess process({"/bin/bash", "-c", "ulimit -f 300; exec \"$@\"", "bash",
                        torquer::test::ProgramPath("torquer-simulator"), "--scene",
                        bench.scene.path(), "--script", bench.Path("script.csv"), "--states",
                        bench.Path("states")});
  CHECK(process.Wait() == 2);
  CHECK_THAT(process.Error(), Contains("File too large") && Contains("states.partial"));
  CHECK(Contents(bench.Path("states")) == "old");
  CheckRowsAreWhole(bench.Path("states.partial"));
  CHECK(fs::file_size(bench.Path("states.partial")) > 100'000);
}

TEST_CASE("A stopped script leaves whole rows, or no file", "[programs]") {
  const Bench bench;
  WriteLongScript(bench.Path("script.csv"));
  fs::create_directory(bench.Path("states"));
  for (const std::string signal : {"HUP", "INT", "TERM", "KILL"}) {
    for (const std::string after_s : {"0.15"}) {
      INFO(signal << " after " << after_s << " s");
      const std::string path = bench.Path("states/" + signal + after_s);
      ChildProcess process({"/usr/bin/timeout", "-s", signal, after_s,
                            torquer::test::ProgramPath("torquer-simulator"), "--scene",
                            bench.scene.path(), "--script", bench.Path("script.csv"), "--states",
                            path});
      process.Wait();
      if (fs::exists(path)) CheckRowsAreWhole(path);
      fs::remove(path);
      CHECK(fs::is_empty(bench.Path("states")));
    }
  }
}

TEST_CASE("A scene in a folder whose name is not UTF-8 is run and recorded", "[programs]") {
  const Bench bench;
  const std::string folder = bench.Path("caf\xe9");
  fs::create_directory(folder);
  fs::copy_file(bench.scene.path(), folder + "/s.toml");
  ChildProcess process({torquer::test::ProgramPath("torquer-simulator"), "--scene",
                        folder + "/s.toml", "--script", bench.Path("script.csv"), "--states",
                        folder + "/states", "--record", folder + "/record"});
  CHECK(process.Wait() == 0);
  CHECK(process.Error().empty());
  CHECK_THAT(Contents(folder + "/record"), Contains("state_hash"));
  CHECK_THAT(Contents(folder + "/states"), Contains("nodes_mm"));
}
