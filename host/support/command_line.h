// Words after a program's name, for programs whose options are "--name VALUE" and "--flag".
#pragma once

#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <functional>
#include <map>
#include <string>
#include <utility>
#include <vector>

#include "host/support/error.h"
#include "host/support/program.h"

namespace torquer {

/// The number that `text` is. Throws UserError naming `option` where it is none, or outside of
/// low .. high.
inline double NumberIn(const std::string& option, const std::string& text, double low,
                       double high) {
  char* end = nullptr;
  const double value = std::strtod(text.c_str(), &end);
  if (text.empty() || *end != '\0' || !std::isfinite(value)) {
    throw UserError(option + " '" + text + "': is no number");
  }
  if (value < low || value > high) {
    char range[80];
    std::snprintf(range, sizeof(range), "': must be from %g to %g", low, high);
    throw UserError(option + " '" + text + range);
  }
  return value;
}

/// Declare the options, then Parse() once.
class CommandLine {
 public:
  /// `name VALUE`: `take` gets the value, once for each time that it is given.
  void Option(const std::string& name, std::function<void(const std::string&)> take) {
    options_[name] = {true, std::move(take)};
  }
  /// As above, into `value`.
  void Option(const std::string& name, std::string& value) {
    Option(name, [&value](const std::string& given) { value = given; });
  }
  /// The one word that is no option, into `value`.
  void Operand(std::string& value) { operand_ = &value; }
  /// `name` alone sets `value`.
  void Flag(const std::string& name, bool& value) {
    options_[name] = {false, [&value](const std::string&) { value = true; }};
  }

  /// Throws UserError naming the word that is unknown or lacks its value; `usage` ends the message.
  void Parse(int argc, char** argv, const std::string& usage) const {
    const std::vector<std::string> words(argv + 1, argv + argc);
    for (std::size_t i = 0; i < words.size(); ++i) {
      const auto found = options_.find(words[i]);
      if (found == options_.end() && operand_ && operand_->empty() && !words[i].starts_with('-')) {
        *operand_ = words[i];
        continue;
      }
      if (found == options_.end()) {
        throw UserError("unknown argument '" + words[i] + "'\n" + usage);
      }
      const auto& [has_value, take] = found->second;
      if (has_value && i + 1 == words.size()) {
        throw UserError(words[i] + " needs a value\n" + usage);
      }
      take(has_value ? words[++i] : std::string());
    }
  }

 private:
  std::map<std::string, std::pair<bool, std::function<void(const std::string&)>>> options_;
  std::string* operand_ = nullptr;
};

}  // namespace torquer
