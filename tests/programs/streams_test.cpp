// Standard streams of a program that only answers or refuses. One at a time, each is closed, full,
// limited or opened the wrong way. The program must get no signal, not wait, and exit with the true
// status.
#include <fcntl.h>
#include <sys/resource.h>
#include <sys/wait.h>
#include <unistd.h>

#include <array>
#include <catch2/catch.hpp>
#include <map>

#include "tests/programs/every_program.h"
#include "tests/support/file_contents.h"
#include "tests/support/paths.h"
#include "tests/support/scenes.h"
#include "tests/support/temporary_folder.h"

namespace {

using Catch::Contains;

enum class Stream { kGood, kClosed, kFull, kLimited, kWrongWay };
const std::map<Stream, std::string> kNames = {{Stream::kGood, "good"},
                                              {Stream::kClosed, "closed"},
                                              {Stream::kFull, "full"},
                                              {Stream::kLimited, "limited"},
                                              {Stream::kWrongWay, "opened the wrong way"}};

// Standard input, output and error of a run.
using Streams = std::array<Stream, 3>;

constexpr unsigned kMostSeconds = 60;
constexpr int kKilled = 128;

struct StreamsOutcome {
  int status = -1;  // kKilled + signal if killed; SIGALRM after kMostSeconds
  std::string output, error;
};

// A run of a program, with a folder for the output of its streams.
class StreamsRun {
 public:
  StreamsRun(const std::string& program, std::vector<std::string> words, const Streams& streams) {
    words.insert(words.begin(), torquer::test::ProgramPath(program));
    std::vector<char*> arguments;
    for (std::string& word : words) arguments.push_back(word.data());
    arguments.push_back(nullptr);
    const std::array<std::string, 3> files = {"/dev/null", folder_.Path("out"),
                                              folder_.Path("err")};
    const pid_t child = fork();
    if (child == 0) {
      for (int number = 0; number < 3; ++number) {
        Give(number, streams[static_cast<std::size_t>(number)],
             files[static_cast<std::size_t>(number)].c_str());
      }
      close_range(3, ~0U, 0);
      alarm(kMostSeconds);
      execv(arguments[0], arguments.data());
      _exit(127);
    }
    int status = 0;
    waitpid(child, &status, 0);
    outcome_.status = WIFSIGNALED(status) ? kKilled + WTERMSIG(status) : WEXITSTATUS(status);
    outcome_.output = torquer::test::Contents(files[1]);
    outcome_.error = torquer::test::Contents(files[2]);
  }
  const StreamsOutcome& outcome() const { return outcome_; }

 private:
  static void Give(int number, Stream stream, const char* file) {
    const bool reads = number == STDIN_FILENO;
    int opened = -1;
    if (stream == Stream::kFull) {
      opened = open("/dev/full", O_RDWR);
    } else if (stream == Stream::kWrongWay) {
      opened = open("/dev/null", reads ? O_WRONLY : O_RDONLY);
    } else if (stream != Stream::kClosed) {
      opened = open(file, reads ? O_RDONLY : O_WRONLY | O_CREAT | O_TRUNC, 0600);
    }
    if (stream == Stream::kLimited) {
      const rlimit none = {0, 0};
      setrlimit(RLIMIT_FSIZE, &none);
    }
    if (stream == Stream::kClosed) close(number);
    if (opened >= 0 && opened != number) {
      dup2(opened, number);
      close(opened);
    }
  }

  torquer::test::TemporaryFolder folder_;
  StreamsOutcome outcome_;
};

StreamsOutcome RunWith(const std::string& program, const std::vector<std::string>& words,
                       const Streams& streams) {
  return StreamsRun(program, words, streams).outcome();
}

// Arguments that are valid but with which the program then fails.
std::vector<std::string> FailingWords(const std::string& program) {
  static const std::map<std::string, std::vector<std::string>> words = {
      {"torquer-calibrate", {"check", "none.toml"}},
      {"torquer-checksum-image", {"none.hex", "none.out"}},
      {"torquer-clip", {"none.log", "none.mp4"}},
      {"torquer-daemon", {"--source", "socket", "--calibration", "none.toml"}},
      {"torquer-emulator", {"--motion", "none.csv"}},
      {"torquer-replay", {"none.log"}},
      {"torquer-report", {"none.log"}},
      {"torquer-simulator", {"--scene", "none.toml", "--script", "none.csv"}},
  };
  const auto found = words.find(program);
  return found != words.end() ? found->second
                              : std::vector<std::string>{"no_such_file", "no_such_word"};
}

const std::array<Stream, 4> kBad = {Stream::kClosed, Stream::kFull, Stream::kLimited,
                                    Stream::kWrongWay};

}  // namespace

TEST_CASE("No state of standard input changes the output of a program", "[programs]") {
  for (const std::string& program : torquer::test::Programs()) {
    for (const bool fails : {false, true}) {
      const std::vector<std::string> words =
          fails ? FailingWords(program) : std::vector<std::string>{"--help"};
      CAPTURE(program, words);
      const StreamsOutcome good = RunWith(program, words, {});
      CHECK(good.status == (fails ? 2 : 0));
      for (const Stream bad : {Stream::kClosed, Stream::kFull, Stream::kWrongWay}) {
        CAPTURE(kNames.at(bad));
        const StreamsOutcome outcome = RunWith(program, words, {bad});
        CHECK(outcome.status == good.status);
        CHECK(outcome.output == good.output);
        CHECK(outcome.error == good.error);
      }
    }
  }
}

TEST_CASE("A program ends correctly for any state of standard output and error", "[programs]") {
  for (const std::string& program : torquer::test::Programs()) {
    const std::vector<std::string> fails = FailingWords(program);
    for (const Stream bad : kBad) {
      CAPTURE(program, kNames.at(bad));
      // every_program_test covers full standard output, and refusals without standard error.
      if (bad != Stream::kFull) {
        const StreamsOutcome unsaid =
            RunWith(program, {"--help"}, {Stream::kGood, bad, Stream::kGood});
        CHECK(unsaid.status == 2);
        // The limit applies to the message too.
        if (bad != Stream::kLimited) {
          CHECK_THAT(unsaid.error, Contains("standard output cannot be written"));
        }
      }
      CHECK(RunWith(program, fails, {Stream::kGood, bad, Stream::kGood}).status == 2);
      if (bad != Stream::kLimited) {
        const StreamsOutcome silent =
            RunWith(program, {"--help"}, {Stream::kGood, Stream::kGood, bad});
        CHECK(silent.status == 0);
        CHECK_THAT(silent.output, Contains("usage: " + program));
      }
    }
    CAPTURE(program);
    const Streams none = {Stream::kClosed, Stream::kClosed, Stream::kClosed};
    CHECK(RunWith(program, {"--help"}, none).status == 2);
    CHECK(RunWith(program, fails, none).status == 2);
  }
}

TEST_CASE("A conversation by streams that cannot be had is refused", "[programs]") {
  const torquer::test::SceneFile scene;
  const std::string script = scene.Beside("script.csv");
  std::ofstream(script) << "time_s,guidewire.insertion_mm\n0.001,0.1\n";
  const auto talk = [&](const std::string& rows, const std::string& states, Streams streams) {
    return RunWith("torquer-simulator",
                   {"--scene", scene.path(), "--script", rows, "--states", states}, streams);
  };
  CHECK(talk(script, "-", {}).status == 0);
  for (const Stream bad : {Stream::kClosed, Stream::kFull, Stream::kWrongWay}) {
    CAPTURE(kNames.at(bad));
    const StreamsOutcome unread = talk("-", "-", {bad, Stream::kGood, Stream::kGood});
    CHECK(unread.status == 2);
    CHECK_THAT(unread.error, Contains("standard input: "));
    const StreamsOutcome unwritten = talk(script, "-", {Stream::kGood, bad, Stream::kGood});
    CHECK(unwritten.status == 2);
    CHECK_THAT(unwritten.error, Contains("standard output: cannot be written"));
  }
  CHECK(talk(script, "-", {Stream::kGood, Stream::kLimited, Stream::kGood}).status == 2);
}
