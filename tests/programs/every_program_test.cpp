// Command-line conventions. Every program of the build answers --help, --version and --completion
// alike, and refuses a bad command line alike.
#include "tests/programs/every_program.h"

#include <algorithm>
#include <catch2/catch.hpp>
#include <regex>
#include <set>
#include <sstream>

#include "host/support/number.h"
#include "tests/support/child_process.h"
#include "tests/support/paths.h"
#include "tests/support/sanitizer.h"
#include "tests/support/temporary_folder.h"
#include "torquer_version.h"

using Catch::Contains;
using Catch::StartsWith;
using torquer::test::ChildProcess;
using torquer::test::Programs;
using torquer::test::Words;

namespace {

struct ProgramOutcome {
  int status = -1;
  std::string output, error;
};

ProgramOutcome RunProgram(const std::string& program, const Words& command, const Words& words) {
  // A program that ignores its command line might do its work instead and never end.
  Words all{"/usr/bin/timeout", "120", torquer::test::ProgramPath(program)};
  all.insert(all.end(), command.begin(), command.end());
  all.insert(all.end(), words.begin(), words.end());
  ChildProcess process(all);
  ProgramOutcome outcome;
  outcome.status = process.Wait();
  outcome.output = process.Output();
  outcome.error = process.Error();
  return outcome;
}

// An option as --help shows it.
struct Option {
  std::string name;
  std::string placeholder;  // empty for a flag
  std::string range;        // as text, "0 to 1"
  double low = 0, high = 0;
  bool repeats = false;
};

std::vector<Option> OptionsIn(const std::string& help) {
  static const std::regex row(R"(\n  (?:-[a-zA-Z], )?(--[a-z][-a-z0-9]*)( [^ \n]+)?)");
  static const std::regex range(R"(\(((-?[0-9.e+]+) to (-?[0-9.e+]+))[,)])");
  std::vector<Option> options;
  for (std::sregex_iterator match(help.begin(), help.end(), row), end; match != end; ++match) {
    Option option;
    option.name = (*match)[1];
    option.placeholder = (*match)[2].length() > 0 ? (*match)[2].str().substr(1) : "";
    // Lines of this option: up to the next option, group or paragraph.
    const auto begin = static_cast<std::size_t>(match->position()) + 1;
    std::size_t stop = help.find("\n  -", begin);
    stop = std::min(stop, help.find("\n\n", begin));
    const std::string text =
        std::regex_replace(help.substr(begin, stop - begin), std::regex("\\s+"), " ");
    std::smatch found;
    if (std::regex_search(text, found, range)) {
      option.range = found[1];
      option.low = *torquer::ParseNumber(found[2].str());
      option.high = *torquer::ParseNumber(found[3].str());
    }
    option.repeats = text.find("may be repeated") != std::string::npos;
    options.push_back(option);
  }
  return options;
}

std::vector<Words> CommandsIn(const std::string& help) {
  std::vector<Words> commands;
  const std::size_t heading = help.find("\nCommands:\n");
  if (heading == std::string::npos) return commands;
  std::istringstream lines(help.substr(heading + 11));
  for (std::string line; std::getline(lines, line) && line.starts_with("  ");) {
    if (line[2] == ' ') continue;
    commands.push_back({line.substr(2, line.find(' ', 2) - 2)});
  }
  return commands;
}

void CheckHelp(const std::string& program, const Words& command, const ProgramOutcome& help) {
  std::string called = program;
  for (const std::string& word : command) called += " " + word;
  CHECK(help.status == 0);
  CHECK(help.error.empty());
  CHECK_THAT(help.output, StartsWith("usage: " + called));
  std::istringstream lines(help.output);
  for (std::string line; std::getline(lines, line);) {
    CAPTURE(line);
    CHECK(line.size() <= 80);
    CHECK((line.empty() || line.back() != ' '));
  }
  CHECK(RunProgram(program, command, {"-h"}).output == help.output);
}

void CheckRefusals(const std::string& program, const Words& command,
                   const std::vector<Option>& options) {
  const auto refuses = [&](const Words& words, const std::vector<std::string>& expected) {
    CAPTURE(words);
    const ProgramOutcome outcome = RunProgram(program, command, words);
    CHECK(outcome.status == 2);
    CHECK(outcome.output.empty());
    CHECK_THAT(outcome.error, StartsWith(program + ": "));
    CHECK_THAT(outcome.error, Contains("--help'."));
    for (const std::string& text : expected) CHECK_THAT(outcome.error, Contains(text));
  };
  refuses({"--no-such-option"}, {"unknown option '--no-such-option'"});
  refuses({"--halp"}, {"unknown option '--halp'; did you mean --help?"});
  for (const Option& option : options) {
    if (option.placeholder.empty()) {
      if (option.name != "--help" && option.name != "--version") {
        refuses({option.name + "=yes"}, {option.name + " takes no value"});
      }
      continue;
    }
    refuses({option.name}, {option.name + " needs a value (" + option.placeholder + ")"});
    refuses({option.name, "--help"}, {option.name + " needs a value"});
    if (option.range.empty()) continue;
    const std::string remedy = "number from " + option.range;
    const std::vector<std::string> no_numbers = {"", "abc", "nan", "inf", "1e999", "0x1", "1 2"};
    for (std::size_t k = 0; k < no_numbers.size(); ++k) {
      // Under a sanitizer every text and every option is tested, but not every pair.
      if (torquer::test::kUnderSanitizer && (k + option.name.size()) % 3 != 0) continue;
      const std::string& text = no_numbers[k];
      refuses({option.name, text}, {option.name + " '" + text + "'", remedy});
    }
    for (const double bad : {option.low - 1.0, 2.0 * option.high + 1.0}) {
      std::ostringstream text;
      text.precision(17);
      text << bad;
      refuses({option.name + "=" + text.str()},
              {option.name + " '" + text.str() + "': is out of range", remedy});
    }
    if (!option.repeats) {
      std::ostringstream text;
      text << option.low;
      refuses({option.name, text.str(), option.name, text.str()},
              {option.name + " is given 2 times"});
    }
  }
}

// Completions that bash offers for an unfinished command line that ends with `last`.
std::set<std::string> Completions(const std::string& program, const std::string& script,
                                  const Words& words) {
  std::string function = "_" + program;
  std::replace(function.begin(), function.end(), '-', '_');
  std::string line = "COMP_WORDS=('" + program + "'";
  for (const std::string& word : words) line += " '" + word + "'";
  line += ")\nCOMP_CWORD=" + std::to_string(words.size()) + "\n" + function +
          "\nprintf '%s\\n' \"${COMPREPLY[@]}\"\n";
  ChildProcess bash({"/bin/bash", "-uc", script + "\n" + line});
  CHECK(bash.Wait() == 0);
  CHECK(bash.Error().empty());
  std::set<std::string> offered;
  std::istringstream lines(bash.Output());
  for (std::string each; std::getline(lines, each);) {
    if (!each.empty()) offered.insert(each);
  }
  return offered;
}

void CheckCompletion(const std::string& program, const std::string& script, const Words& command,
                     const std::vector<Option>& options) {
  std::set<std::string> names;
  for (const Option& option : options) names.insert(option.name);
  Words words = command;
  words.emplace_back("--");
  CHECK(Completions(program, script, words) == names);
  for (const Option& option : options) {
    // A prefix completes to an option; after an option that takes a value, none is offered.
    words = command;
    words.push_back(option.name.substr(0, 4));
    CHECK(Completions(program, script, words).count(option.name) == 1);
    if (option.placeholder.empty()) continue;
    words = command;
    words.push_back(option.name);
    words.emplace_back("");
    for (const std::string& offered : Completions(program, script, words)) {
      CHECK(names.count(offered) == 0);
    }
  }
}

}  // namespace

TEST_CASE("There are programs", "[programs]") {
  const std::vector<std::string> programs = Programs();
  for (const char* name : {"torquer-daemon", "torquer-emulator", "torquer-emulator-usbip",
                           "torquer-flash", "torquer-calibrate", "torquer-clip", "torquer-monitor",
                           "torquer-recorder", "torquer-replay", "torquer-report",
                           "torquer-simulator", "torquer-viewer", "torquer-checksum-image"}) {
    CAPTURE(name);
    CHECK(std::count(programs.begin(), programs.end(), name) == 1);
  }
  if (torquer::test::kUnderSanitizer) return;
  for (const char* name : {"torquer-study", "daemon_benchmark", "bench-vessel"}) {
    CAPTURE(name);
    CHECK(std::count(programs.begin(), programs.end(), name) == 1);
  }
}

TEST_CASE("Every program explains itself and refuses a bad command line", "[programs]") {
  for (const std::string& program : Programs()) {
    CAPTURE(program);
    const ProgramOutcome help = RunProgram(program, {}, {"--help"});
    if (help.status != 0) {
      FAIL_CHECK("--help is not answered; a program that is left from an earlier build: delete it");
      continue;
    }
    CheckHelp(program, {}, help);
    const ProgramOutcome version = RunProgram(program, {}, {"--version"});
    CHECK(version.status == 0);
    CHECK(version.output == program + " " + torquer::kVersion + "\n");
    const ProgramOutcome completion = RunProgram(program, {}, {"--completion", "bash"});
    CHECK(completion.status == 0);
    CHECK(completion.error.empty());

    const std::vector<Option> options = OptionsIn(help.output);
    std::set<std::string> names;
    for (const Option& option : options) names.insert(option.name);
    for (const char* name : {"--help", "--version", "--completion"}) CHECK(names.count(name) == 1);
    CheckRefusals(program, {}, options);
    CheckCompletion(program, completion.output, {}, options);

    const std::vector<Words> commands = CommandsIn(help.output);
    for (const Words& command : commands) {
      CAPTURE(command);
      const ProgramOutcome own_help = RunProgram(program, command, {"--help"});
      CheckHelp(program, command, own_help);
      CheckRefusals(program, command, OptionsIn(own_help.output));
      CheckCompletion(program, completion.output, command, OptionsIn(own_help.output));
      CHECK(Completions(program, completion.output, {command[0].substr(0, 2)}).count(command[0]));
    }
    if (!commands.empty()) CHECK(RunProgram(program, {}, {}).status == 2);
  }
}

TEST_CASE("A failed write to standard output is reported", "[programs]") {
  for (const std::string& program : Programs()) {
    CAPTURE(program);
    ChildProcess shell(
        {"/bin/bash", "-c", torquer::test::ProgramPath(program) + " --help > /dev/full"});
    CHECK(shell.Wait() == 2);
    CHECK_THAT(shell.Error(), Contains("standard output cannot be written"));
  }
}

TEST_CASE("No state of standard error changes how a program ends", "[programs]") {
  // Appended after the program's own words, "$@". A pipe loses its reader before the program
  // begins.
  const std::string stream =
      GENERATE("2> /dev/full", "2>&-", "2>&- 1>&- 0>&-", "2> >(exit) ", "2> small");
  CAPTURE(stream);
  const torquer::test::TemporaryFolder folder;
  const bool limited = stream == "2> small";
  for (const std::string& program : Programs()) {
    const std::vector<Words> bad = {{"--no-such-option"}, {"no_such_file", "no_such_word"}};
    for (const Words& words : bad) {
      CAPTURE(program, words);
      Words all = {"/bin/bash", "-c",
                   "cd " + folder.Path("") + "; " + (limited ? "ulimit -f 0; " : "") +
                       "/usr/bin/timeout 120 \"$0\" \"$@\" " + stream +
                       (stream.find(">(") == std::string::npos ? "" : "; exit $?"),
                   torquer::test::ProgramPath(program)};
      all.insert(all.end(), words.begin(), words.end());
      ChildProcess shell(all);
      const int status = shell.Wait();
      CHECK((status == 2 || (words.size() == 2 && status < 124)));
    }
  }
}

TEST_CASE("Control characters of a message are shown as escapes", "[programs]") {
  for (const std::string& program : Programs()) {
    CAPTURE(program);
    ChildProcess process({"/usr/bin/timeout", "120", torquer::test::ProgramPath(program),
                          "--no\x1b]0;title\x07\xc2\x9b"});
    CHECK(process.Wait() == 2);
    CHECK_THAT(process.Error(), Contains("\\x1b]0;title\\x07"));
    CHECK(process.Error().find('\x1b') == std::string::npos);
  }
}

TEST_CASE("A limit of the system is named with its remedy", "[programs]") {
  for (const std::string& program : Programs()) {
    CAPTURE(program);
    for (int files = 3; files < 8; ++files) {
      ChildProcess shell(
          {"/bin/bash", "-c",
           "ulimit -n " + std::to_string(files) + "; exec /usr/bin/timeout 120 \"$0\" /dev/null x",
           torquer::test::ProgramPath(program)});
      shell.Wait();
      CHECK_THAT(shell.Error(), !Contains("please report"));
    }
  }
}
