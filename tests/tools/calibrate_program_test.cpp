// torquer-calibrate as a process: its scripts, its files, and the files that it leaves.
#include <catch2/catch.hpp>
#include <csignal>
#include <filesystem>
#include <fstream>
#include <iterator>

#include "calibration/calibration_file.h"
#include "tests/support/child_process.h"
#include "tests/support/paths.h"
#include "tests/support/reports.h"
#include "tests/support/socket_device.h"
#include "tests/support/temporary_folder.h"

namespace {

using Catch::Contains;
using torquer::calibration::Calibration;
using torquer::calibration::ParametersOf;
using torquer::calibration::ReadCalibration;
using torquer::test::ChildProcess;
using torquer::test::TemporaryFolder;

const std::string kProgram = torquer::test::ProgramPath("torquer-calibrate");
constexpr char kBegin[] =
    "torquer-calibrate script 1\ndevice SCRIPTED-1 1200\nrest 2\nmark\nrest 0.3\n";

// A stroke in counts, back and forth, with a mark at both ends.
std::string Stroke(int axial, int transverse) {
  const std::string there = std::to_string(axial) + " " + std::to_string(transverse);
  const std::string back = std::to_string(-axial) + " " + std::to_string(-transverse);
  return "move " + there + " 0.5\nmark\nrest 0.3\nmove " + back + " 0.5\nmark\nrest 0.3\n";
}
std::string Pushes(int count) {
  std::string text;
  for (int i = 0; i < count; ++i) text += Stroke(7087, 124);
  return text;
}
// Three raised pushes that count 0.1 % more, with their first mark.
std::string Raised() {
  std::string text = "mark\nrest 0.3\n";
  for (int i = 0; i < 3; ++i) text += Stroke(7094, 124);
  return text;
}
// Turns without the first mark.
std::string MoreTurns(int count) {
  std::string text;
  for (int i = 0; i < count; ++i) text += Stroke(-52, 2968);
  return text;
}
// The raised pushes, then turns.
std::string Turns(int count) { return Raised() + "mark\nrest 0.3\n" + MoreTurns(count); }

std::string ReadAll(const std::string& path) {
  std::ifstream file(path, std::ios::binary);
  return {std::istreambuf_iterator<char>(file), std::istreambuf_iterator<char>()};
}

struct Bench {
  Bench() : output(folder.Path("kept/calibration.toml")) {
    std::filesystem::create_directory(folder.Path("kept"));
    std::ofstream(output) << kOld;
  }
  int Run(const std::string& script, std::vector<std::string> more = {}) {
    std::ofstream(folder.Path("a.script")) << script;
    std::vector<std::string> words{kProgram, "--script", folder.Path("a.script"), "--output",
                                   output};
    words.insert(words.end(), more.begin(), more.end());
    ChildProcess program(words);
    const int status = program.Wait();
    said = program.Output();
    error = program.Error();
    return status;
  }
  // Checks that the file is unchanged and that no other file was left.
  void CheckUntouched() const {
    CHECK(ReadAll(output) == kOld);
    int files = 0;
    for (const auto& entry : std::filesystem::directory_iterator(folder.Path("kept"))) {
      CAPTURE(entry.path());
      ++files;
    }
    CHECK(files == 1);
  }

  static constexpr char kOld[] = "the calibration before\n";
  TemporaryFolder folder;
  std::string output, said, error;
};

}  // namespace

TEST_CASE("A run ends with parameters, residuals, a verdict, a file and a picture") {
  Bench bench;
  REQUIRE(bench.Run(kBegin + Pushes(6) + Turns(5) + "skip joystick\n") == 0);
  CHECK(bench.error.empty());
  CHECK_THAT(bench.said, Contains("Pushes 0/6: Pull it back to the near stop, then press Enter."));
  CHECK_THAT(bench.said, Contains("ok push 6: +7087 axial, +124 transverse counts"));
  CHECK_THAT(bench.said, Contains("misalignment         1.0024 degrees"));
  CHECK_THAT(bench.said, Contains("That is good."));
  CHECK_THAT(bench.said, Contains("Saved as " + bench.output));

  const Calibration calibration = ReadCalibration(bench.output);
  CHECK(calibration.device == "SCRIPTED-1");
  CHECK(calibration.motion.cpi == 1200);
  CHECK(ParametersOf(calibration.motion).gain_mm_per_count ==
        Approx(150.0 / std::hypot(7087, 124)));
  CHECK(calibration.motion.standard_error[0][0] > 0.0);
  CHECK_THAT(calibration.note, Contains("6 pushes of 150 mm +- 0.5 mm between stops, 5 x 2 turns; "
                                        "rest checked, height measured, joystick nominal"));
  CHECK(ReadAll(bench.folder.Path("kept/calibration.svg")).ends_with("</svg>\n"));
}

TEST_CASE("The file is named after the device's serial number unless set otherwise") {
  TemporaryFolder folder;
  std::ofstream(folder.Path("a.script")) << kBegin + Pushes(3) + Turns(3) + "skip joystick\n";
  setenv("XDG_CONFIG_HOME", folder.Path("config").c_str(), 1);
  ChildProcess program({kProgram, "--script", folder.Path("a.script"), "--pushes", "3",
                        "--turn-strokes", "3", "--length", "149.5", "--ruler", "--plot",
                        folder.Path("plot.svg")});
  unsetenv("XDG_CONFIG_HOME");
  REQUIRE(program.Wait() == 0);
  const Calibration calibration = ReadCalibration(folder.Path("config/torquer/SCRIPTED-1.toml"));
  CHECK(ParametersOf(calibration.motion).gain_mm_per_count ==
        Approx(149.5 / std::hypot(7087, 124)));
  CHECK_THAT(calibration.note, Contains("by a ruler"));
  CHECK(std::filesystem::exists(folder.Path("plot.svg")));
}

TEST_CASE("Bad strokes are reported with the reason, and requested again") {
  Bench bench;
  const std::string script = kBegin + Pushes(3) + Stroke(6600, 115) +  // stopped short
                             "move 3000 50 0.3\nlift 0.2\nmove 4087 74 0.3\nmark\nrest 0.3\n"
                             "move -7087 -124 0.5\nmark\nrest 0.3\n" +  // lifted
                             Stroke(7087, 300) +                        // turned
                             "move 3000 50 0.3\nreset\nrest 0.5\nmove -3000 -50 0.3\nmark\n"
                             "rest 0.3\n" +  // restarted
                             Stroke(7000, 122) +
                             "undo\nmark\nrest 0.3\n" + Pushes(3) + Turns(2) + Stroke(-26, 1484) +
                             Stroke(2968, 0) + MoreTurns(3) + "skip joystick\n";
  const int status = bench.Run(script);
  CAPTURE(bench.said, bench.error);
  REQUIRE(status == 0);
  CHECK_THAT(bench.said, Contains("push 4 is not used: 10.3 mm shorter than the others"));
  CHECK_THAT(bench.said, Contains("push 5 is not used: the sensor was lifted"));
  CHECK_THAT(bench.said, Contains("push 6 is not used: turned while pushing"));
  CHECK_THAT(bench.said, Contains("push 7 is not used: the device restarted"));
  CHECK_THAT(bench.said, Contains("the last stroke is undone"));
  CHECK_THAT(bench.said, Contains("turns 3 is not used: about 1.0 turns"));
  CHECK_THAT(bench.said, Contains("turns 4 is not used: pushed while turning"));
  CHECK(ParametersOf(ReadCalibration(bench.output).motion).gain_mm_per_count ==
        Approx(150.0 / std::hypot(7087, 124)));
}

TEST_CASE("After any early end of a run, the old file stays") {
  Bench bench;
  SECTION("given up") {
    CHECK(bench.Run(kBegin + Pushes(2) + "quit\n") == 130);
    CHECK_THAT(bench.said, Contains("Stopped; nothing was written."));
  }
  SECTION("a script that ends too early") {
    CHECK(bench.Run(kBegin + Pushes(6) + Turns(3)) == 2);
    CHECK_THAT(bench.error, Contains("the script ended in the step 'turns'"));
  }
  SECTION("an invalid script") {
    CHECK(bench.Run("nonsense\n") == 2);
    CHECK_THAT(bench.error, Contains("torquer-calibrate: ") && Contains("a.script:1: "));
  }
  SECTION("a bad option") {
    const auto [option, value, expected] = GENERATE(table<std::string, std::string, std::string>({
        {"--length", "long", "--length 'long': is not a number"},
        {"--length", "5", "--length '5': is out of range; give a number from 10 to 1000 (MM)"},
        {"--length-error", "0", "--length-error '0': is out of range"},
        {"--length-error", "16", "length error = 16: must be from 0.001 mm to a tenth of"},
        {"--pushes", "2", "--pushes '2': is out of range"},
        {"--turns", "1.5", "--turns '1.5': is not a whole number"},
        {"--radius", "0", "--radius '0': is out of range"},
        {"--sorcery", "usb", "unknown option '--sorcery'"},
    }));
    CHECK(bench.Run(kBegin, {option, value}) == 2);
    CHECK_THAT(bench.error, Contains(expected));
  }
  SECTION("a picture that cannot be written") {
    CHECK(bench.Run(kBegin + Pushes(6) + Turns(5) + "skip joystick\n",
                    {"--plot", bench.folder.Path("nowhere/plot.svg")}) == 2);
    CHECK_THAT(bench.error, Contains("nowhere/plot.svg: cannot be written"));
  }
  SECTION("a result that is too poor") {
    std::string script = kBegin;
    for (const int axial : {6000, 7000, 8000, 6300, 7600, 8200}) script += Stroke(axial, 0);
    CHECK(bench.Run(script + Turns(5) + "skip joystick\n") == 1);
    CHECK_THAT(bench.said, Contains("The calibration is too inaccurate, so it is not saved."));
  }
  bench.CheckUntouched();
}

TEST_CASE("Ctrl-C in the middle of a run keeps the old file") {
  Bench bench;
  torquer::test::SocketDevice device(bench.folder.Path("socket"));
  ChildProcess program({kProgram, "--source", "socket", "--socket", bench.folder.Path("socket"),
                        "--output", bench.output});
  REQUIRE(device.WaitForHost());
  torquer::protocol::InputReport report = torquer::test::StillReport();
  for (int i = 0; i < 3000; ++i) {
    device.Send(report);
    report = torquer::test::Next(report);
  }
  program.Signal(SIGINT);
  CHECK(program.Wait() == 130);
  CHECK_THAT(program.Output(), Contains("Device SCRIPTED-1 at 1200 cpi"));
  CHECK_THAT(program.Output(), Contains("Stopped; nothing was written."));
  bench.CheckUntouched();
}

TEST_CASE("No device, firmware that does not fit, and no serial number are reported") {
  Bench bench;
  const std::string socket = bench.folder.Path("socket");
  const std::vector<std::string> words{kProgram, "--source", "socket",    "--socket",
                                       socket,   "--output", bench.output};
  const auto error_of = [&] {
    ChildProcess program(words);
    CHECK(program.Wait() == 2);
    return program.Error();
  };
  SECTION("firmware") {
    torquer::test::SocketDevice device(socket);
    device.identity.protocol_version = 9;
    CHECK_THAT(error_of(), Contains("firmware has protocol version 9, this program has 1") &&
                               Contains("torquer-flash"));
  }
  SECTION("serial number") {
    torquer::test::SocketDevice device(socket, "");
    CHECK_THAT(error_of(), Contains("has no serial number"));
  }
  bench.CheckUntouched();
}

TEST_CASE("The sample run works as documented") {
  const std::string sample = torquer::test::SourcePath("/calibration/sample.script");
  TemporaryFolder folder;
  ChildProcess program({kProgram, "--script", sample, "--output", folder.Path("sample.toml")});
  REQUIRE(program.Wait() == 0);
  CHECK_THAT(program.Output(), Contains("push 3 is not used: 10.2 mm shorter than the others"));
  CHECK_THAT(program.Output(), Contains("push 5 is not used: turned while pushing, by 12 degrees"));
  const auto found = ParametersOf(ReadCalibration(folder.Path("sample.toml")).motion);
  CHECK(found.gain_mm_per_count == Approx(25.4 / 1200 * 1.01).epsilon(0.003));
  CHECK(found.misalignment_rad * 57.29577951 == Approx(3.0).margin(0.05));
  CHECK(found.cylinder_radius_mm == Approx(5.05).epsilon(0.003));
}

TEST_CASE("Help is given") {
  ChildProcess program({kProgram, "--help"});
  CHECK(program.Wait() == 0);
  CHECK_THAT(program.Output(), Contains("usage: torquer-calibrate"));
}
