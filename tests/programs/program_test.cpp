// Common frame of all programs, tested with programs defined here.
#include "host/support/program.h"

#include <fcntl.h>
#include <unistd.h>

#include <catch2/catch.hpp>
#include <cerrno>
#include <cstdio>
#include <fstream>
#include <iterator>
#include <new>
#include <optional>
#include <stdexcept>
#include <system_error>

#include "tests/support/temporary_folder.h"

using Catch::Contains;
using Catch::EndsWith;
using Catch::StartsWith;
using torquer::Options;
using torquer::Program;
using torquer::UsageError;

namespace {

// Redirects standard output or standard error to a file for its lifetime.
class Captured {
 public:
  explicit Captured(std::FILE* stream) : stream_(stream) {
    std::fflush(stream);
    before_ = dup(fileno(stream));
    const int file = open(folder_.Path("text").c_str(), O_RDWR | O_CREAT | O_CLOEXEC, 0600);
    dup2(file, fileno(stream));
    close(file);
  }
  ~Captured() { Restore(); }
  Captured(const Captured&) = delete;
  Captured& operator=(const Captured&) = delete;

  std::string Text() {
    Restore();
    std::ifstream file(folder_.Path("text"));
    return {std::istreambuf_iterator<char>(file), std::istreambuf_iterator<char>()};
  }

 private:
  void Restore() {
    if (before_ < 0) return;
    std::fflush(stream_);
    dup2(before_, fileno(stream_));
    close(std::exchange(before_, -1));
  }

  torquer::test::TemporaryFolder folder_;
  std::FILE* stream_;
  int before_ = -1;
};

struct Outcome {
  int status = -1;
  std::string output, error;
};

Outcome Run(
    Program& program, std::vector<std::string> words,
    const std::function<int()>& run = [] { return 0; }) {
  words.insert(words.begin(), "/some/where/program");
  std::vector<char*> arguments;
  for (std::string& word : words) arguments.push_back(word.data());
  Captured output(stdout);
  Captured error(stderr);
  Outcome outcome;
  outcome.status = program.Main(static_cast<int>(words.size()), arguments.data(), run);
  outcome.error = error.Text();
  outcome.output = output.Text();
  return outcome;
}

// A program with one option of each kind.
struct Sample {
  bool flag = false;
  std::string text = "as it was";
  std::vector<std::string> texts;
  std::string choice = "one";
  double number = 1.5;
  std::optional<double> optional;
  std::vector<double> numbers;
  int integer = 3;
  std::optional<std::uint32_t> large;
  std::string custom;
  std::string operand;
  std::vector<std::string> operands;
  bool ran = false;

  Outcome Parse(const std::vector<std::string>& words) {
    Program program("sample", "Shows options.");
    Options& options = program.options();
    options.Flag("--flag", flag, "set it");
    options.Text("--text", "TEXT", text, "some text");
    options.Texts("--texts", "TEXT", texts, "some texts");
    options.Choice("--choice", "KIND", {"one", "two", "three"}, choice, "one of them");
    options.Group("Numbers");
    options.Number("--number", "MM", number, -10, 1000.25, "a length");
    options.Number("--optional", "S", optional, 0, 1e6, "a time");
    options.Numbers("--numbers", "S", numbers, 0, 5, "some times");
    options.Integer("--integer", "N", integer, -5, 100, "a count");
    options.Integer("--large", "N", large, 0, 4294967295, "a large count");
    options.Custom("--custom", "A:B", "a pair", [this](const std::string& given) {
      if (given.find(':') == std::string::npos) throw UsageError("has no colon; write A:B");
      custom += given;
    });
    options.Operand("FILE", operand, "the first word");
    options.Operands("MORE", operands, "all others");
    return Run(program, words, [this] {
      ran = true;
      return 0;
    });
  }
};

}  // namespace

TEST_CASE("Options reach their variables", "[programs]") {
  Sample sample;
  const Outcome outcome = sample.Parse(
      {"--flag",    "--text",   "[a, b]",    "--texts=x", "first",        "--texts",    "-y",
       "--choice",  "two",      "--number",  "-9.5",      "--optional=3", "--numbers",  "1",
       "--numbers", "2.5",      "--integer", "-5",        "--large",      "4294967295", "--custom",
       "1:2",       "--custom", "3:4",       "second",    "third"});
  CHECK(outcome.status == 0);
  CHECK(outcome.error.empty());
  CHECK(sample.ran);
  CHECK(sample.flag);
  CHECK(sample.text == "[a, b]");
  CHECK(sample.texts == std::vector<std::string>{"x", "-y"});
  CHECK(sample.choice == "two");
  CHECK(sample.number == -9.5);
  CHECK(sample.optional == 3.0);
  CHECK(sample.numbers == std::vector<double>{1, 2.5});
  CHECK(sample.integer == -5);
  CHECK(sample.large == 4294967295u);
  CHECK(sample.custom == "1:23:4");
  CHECK(sample.operand == "first");
  CHECK(sample.operands == std::vector<std::string>{"second", "third"});
}

TEST_CASE("An option that is not given keeps its default", "[programs]") {
  Sample sample;
  CHECK(sample.Parse({}).status == 0);
  CHECK(sample.ran);
  CHECK(sample.text == "as it was");
  CHECK(sample.choice == "one");
  CHECK(sample.number == 1.5);
  CHECK_FALSE(sample.optional);
  CHECK(sample.integer == 3);
}

TEST_CASE("A bad command line is refused with option, value and remedy, before any action",
          "[programs]") {
  const auto [words, expected] = GENERATE(table<std::vector<std::string>, std::string>({
      {{"--number", "abc"},
       "--number 'abc': is not a number; give a number from -10 to 1000.25 (MM)"},
      {{"--number", ""}, "--number '': is not a number"},
      {{"--number", "1mm"}, "--number '1mm': is not a number"},
      {{"--number", "nan"}, "--number 'nan': is not a number"},
      {{"--number", "1e999"}, "--number '1e999': is not a number"},
      {{"--number", "1000.26"},
       "--number '1000.26': is out of range; give a number from -10 to 1000.25 (MM)"},
      {{"--number=-10.5"}, "--number '-10.5': is out of range"},
      {{"--numbers", "1", "--numbers", "6"}, "--numbers '6': is out of range"},
      {{"--integer", "2.5"},
       "--integer '2.5': is not a whole number; give a whole number from -5 to 100"},
      {{"--integer", "1e3"}, "--integer '1e3': is out of range"},
      {{"--large", "4294967296"}, "--large '4294967296': is out of range"},
      {{"--large", "-1"}, "--large '-1': is out of range"},
      {{"--choice", "tow"}, "--choice 'tow': is not one of one, two, three; did you mean two?"},
      {{"--custom", "12"}, "--custom '12': has no colon; write A:B"},
      {{"--custom", "1:2", "--custom", "3"}, "--custom '3': has no colon"},
      {{"--text"}, "--text needs a value (TEXT)"},
      {{"--text", "--flag"}, "--text needs a value (TEXT), but --flag follows"},
      {{"--text", "a", "--text", "b"}, "--text is given 2 times; give it once"},
      {{"--flag=yes"}, "--flag takes no value"},
      {{"--flga"}, "unknown option '--flga'; did you mean --flag?"},
      {{"--numbre=3"}, "unknown option '--numbre'; did you mean --number?"},
      {{"--xyzzy"}, "unknown option '--xyzzy'\n"},
      {{"-x"}, "unknown option '-x'\n"},
      {{"--completion", "fish"}, "--completion 'fish': is not one of bash"},
  }));
  Sample sample;
  const Outcome outcome = sample.Parse(words);
  CAPTURE(words);
  CHECK(outcome.status == torquer::kExitUserError);
  CHECK_THAT(outcome.error, StartsWith("sample: " + expected));
  CHECK_THAT(outcome.error, Contains("\nSee 'sample --help'.\n"));
  CHECK(outcome.output.empty());
  CHECK_FALSE(sample.ran);
}

TEST_CASE("A word that no operand takes is refused", "[programs]") {
  Program program("sample", "Takes no operand.");
  const Outcome outcome = Run(program, {"word"});
  CHECK(outcome.status == 2);
  CHECK_THAT(outcome.error, StartsWith("sample: unexpected argument 'word'"));
}

TEST_CASE("Help is laid out in groups with ranges and defaults", "[programs]") {
  Sample sample;
  const Outcome outcome = sample.Parse({"--flag", "--help", "--number", "3"});
  CHECK(outcome.status == 0);
  CHECK_FALSE(sample.ran);
  CHECK(outcome.output ==
        "usage: sample [OPTION]... FILE MORE...\n"
        "\n"
        "Shows options.\n"
        "\n"
        "  FILE                    the first word\n"
        "  MORE                    all others (may be repeated)\n"
        "\n"
        "Options:\n"
        "  --flag                  set it\n"
        "  --text TEXT             some text (default as it was)\n"
        "  --texts TEXT            some texts (may be repeated)\n"
        "  --choice KIND           one of them: one, two, three (default one)\n"
        "\n"
        "Numbers:\n"
        "  --number MM             a length (-10 to 1000.25, default 1.5)\n"
        "  --optional S            a time (0 to 1000000)\n"
        "  --numbers S             some times (0 to 5, may be repeated)\n"
        "  --integer N             a count (-5 to 100, default 3)\n"
        "  --large N               a large count (0 to 4294967295)\n"
        "  --custom A:B            a pair (may be repeated)\n"
        "\n"
        "General:\n"
        "  -h, --help              print this help\n"
        "  --version               print the version\n"
        "  --completion SHELL      print a completion script for bash; load it with:\n"
        "                          source <(sample --completion bash)\n");
}

TEST_CASE("Each subcommand has its own options", "[programs]") {
  struct Commands {
    Program program{"tool", "Does two things."};
    int count = 1;
    std::string name;
    Commands() {
      program.Subcommand("count", "counts").Integer("--from", "N", count, 0, 9, "where it begins");
      program.Subcommand("greet", "says hello").Text("--name", "NAME", name, "whom");
    }
  };
  {
    Commands commands;
    std::string given;
    CHECK(Run(commands.program, {"count", "--from", "4"}, [&] {
            given = commands.program.subcommand();
            return 0;
          }).status == 0);
    CHECK(given == "count");
    CHECK(commands.count == 4);
  }
  const auto error = [](const std::vector<std::string>& words) {
    Commands commands;
    const Outcome outcome = Run(commands.program, words);
    CHECK(outcome.status == 2);
    return outcome.error;
  };
  CHECK(error({}) == "tool: no command given. There are: count, greet\nSee 'tool --help'.\n");
  CHECK_THAT(
      error({"cuont"}),
      StartsWith("tool: unknown command 'cuont'; did you mean count? There are: count, greet"));
  CHECK(error({"count", "--frm", "4"}) ==
        "tool: unknown option '--frm'; did you mean --from?\nSee 'tool count --help'.\n");
  CHECK_THAT(error({"count", "--name", "x"}), StartsWith("tool: unknown option '--name'"));
  CHECK_THAT(error({"count", "--from", "10"}),
             StartsWith("tool: --from '10': is out of range") && Contains("tool count --help"));
  CHECK_THAT(error({"count", "--from"}), StartsWith("tool: --from needs a value (N)"));
  Commands commands;
  CHECK_THAT(
      Run(commands.program, {"greet", "--help"}).output,
      StartsWith("usage: tool greet [OPTION]...\n\nsays hello\n") && Contains("--name NAME"));
}

TEST_CASE("Exceptions become messages and exit statuses", "[programs]") {
  const auto run = [](const std::function<int()>& body) {
    Program program("sample", "Fails.");
    return Run(program, {}, body);
  };
  CHECK(run([] { return 7; }).status == 7);
  const Outcome user = run([]() -> int { throw torquer::UserError("file.toml: is torn"); });
  CHECK(user.status == 2);
  CHECK(user.error == "sample: file.toml: is torn\n");
  const Outcome usage = run([]() -> int { throw UsageError("--a is missing"); });
  CHECK(usage.status == 2);
  CHECK(usage.error == "sample: --a is missing\nSee 'sample --help'.\n");
  // The user can fix a limit or the state of the machine, so this is not a defect.
  const Outcome memory = run([]() -> int { throw std::bad_alloc(); });
  CHECK(memory.status == 2);
  CHECK_THAT(memory.error, StartsWith("sample: std::bad_alloc; close other programs"));
  const Outcome files =
      run([]() -> int { throw std::system_error(EMFILE, std::generic_category(), "pipe2"); });
  CHECK(files.status == 2);
  CHECK_THAT(files.error, StartsWith("sample: pipe2: ") && EndsWith("(ulimit -n)\n"));
  const Outcome defect = run([]() -> int { throw std::logic_error("torn"); });
  CHECK(defect.status == 3);
  CHECK_THAT(defect.error, StartsWith("sample: unexpected error: torn; please report it"));
}
