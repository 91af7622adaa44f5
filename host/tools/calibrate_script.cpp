#include "host/tools/calibrate_script.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <iterator>
#include <optional>
#include <sstream>

#include "host/support/error.h"
#include "host/support/input_file.h"
#include "host/support/number.h"

namespace torquer::tools {
namespace {

constexpr char kFirstLine[] = "torquer-calibrate script 1";
constexpr double kLongestS = 3600.0;

// Number in a statement, with its range.
struct Number {
  const char* name;
  double low, high;
};
struct Form {
  const char* name;
  Statement::Kind kind;
  const char* word;  ///< meaning of the first word after the name; nullptr: no word
  std::vector<Number> numbers;
};

const std::vector<Form>& Forms() {
  using Kind = Statement::Kind;
  static const std::vector<Form> forms{
      {"mark", Kind::kMark, nullptr, {}},
      {"undo", Kind::kUndo, nullptr, {}},
      {"skip", Kind::kSkip, "STEP", {}},
      {"quit", Kind::kQuit, nullptr, {}},
      {"device", Kind::kDevice, "SERIAL", {{"CPI", 1, 60000}}},
      {"rest", Kind::kRest, nullptr, {{"SECONDS", 0, kLongestS}}},
      {"move",
       Kind::kMove,
       nullptr,
       {{"AXIAL", -1e7, 1e7}, {"TRANSVERSE", -1e7, 1e7}, {"SECONDS", 0, kLongestS}}},
      {"lift", Kind::kLift, nullptr, {{"SECONDS", 0, kLongestS}}},
      {"fault", Kind::kFault, nullptr, {{"SECONDS", 0, kLongestS}}},
      {"joystick",
       Kind::kJoystick,
       nullptr,
       {{"X", 0, 1023}, {"Y", 0, 1023}, {"SECONDS", 0, kLongestS}}},
      {"reset", Kind::kReset, nullptr, {}}};
  return forms;
}

std::string Usage(const Form& form) {
  std::string usage = form.name;
  if (form.word != nullptr) usage += std::string(" ") + form.word;
  for (const Number& number : form.numbers) usage += std::string(" ") + number.name;
  return usage;
}

class Parser {
 public:
  explicit Parser(const std::string& path) : path_(path) {}

  Statement Parse(const std::vector<std::string>& words, int line) const {
    const Form* form = nullptr;
    for (const Form& each : Forms()) {
      if (words[0] == each.name) form = &each;
    }
    if (form == nullptr) {
      std::vector<std::string> known;
      for (const Form& each : Forms()) known.push_back(Usage(each));
      Refuse(line, fmt::format("'{}' is unknown; known statements:\n  {}", words[0],
                               fmt::join(known, "\n  ")));
    }
    const std::size_t first_number = form->word != nullptr ? 2 : 1;
    if (words.size() != first_number + form->numbers.size()) {
      Refuse(line, fmt::format("it has {} values; write '{}'", words.size() - 1, Usage(*form)));
    }
    Statement statement;
    statement.kind = form->kind;
    statement.line = line;
    if (form->word != nullptr) statement.word = words[1];
    if (form->kind == Statement::Kind::kSkip && statement.word != "rest" &&
        statement.word != "raised" && statement.word != "joystick") {
      Refuse(line, fmt::format("the step '{}' cannot be skipped; rest, raised and joystick can",
                               statement.word));
    }
    for (std::size_t i = 0; i < form->numbers.size(); ++i) {
      statement.numbers.push_back(Value(words[first_number + i], form->numbers[i], line));
    }
    return statement;
  }

  [[noreturn]] void Refuse(int line, const std::string& problem) const {
    throw UserError(fmt::format("{}:{}: {}", path_, line, problem));
  }

 private:
  double Value(const std::string& word, const Number& number, int line) const {
    const std::optional<double> value = ParseNumber(word);
    if (!value || *value < number.low || *value > number.high) {
      Refuse(line, fmt::format("{} = '{}': must be a number from {:g} to {:g}", number.name, word,
                               number.low, number.high));
    }
    return *value;
  }

  const std::string& path_;
};

}  // namespace

Script ParseScript(const std::string& text, const std::string& path) {
  const Parser parser(path);
  Script script{path, {}};
  std::istringstream lines(text);
  std::string line;
  int number = 0;
  while (std::getline(lines, line)) {
    ++number;
    if (number == 1) {
      if (line != kFirstLine) {
        parser.Refuse(1, fmt::format("'{}': a script begins with the line '{}'", line, kFirstLine));
      }
      continue;
    }
    std::istringstream words(line.substr(0, line.find('#')));
    const std::vector<std::string> split{std::istream_iterator<std::string>(words), {}};
    if (!split.empty()) script.statements.push_back(parser.Parse(split, number));
  }
  if (number == 0) {
    parser.Refuse(1, fmt::format("it is empty; a script begins with the line '{}'", kFirstLine));
  }
  return script;
}

Script ReadScript(const std::string& path) {
  return ParseScript(ReadInputFile(path, "give --script a file"), path);
}

}  // namespace torquer::tools
