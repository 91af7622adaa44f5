// The table of a program's options, and what is printed from it: --help and the completion script.
// Programs declare their options through program.h.
#pragma once

#include <functional>
#include <list>
#include <string>
#include <vector>

#include "host/support/program.h"

namespace torquer {

/// One option or operand.
struct OptionEntry {
  std::string name;         ///< "--length"; of an operand "LOG"
  std::string letter;       ///< "-h"; empty without one
  std::string placeholder;  ///< of its value; empty for a flag
  std::string help;
  std::string group;
  std::string range;                 ///< "0.1 to 1000"; empty without one
  std::string fallback;              ///< the default, as --help shows it; empty without one
  std::vector<std::string> choices;  ///< empty: anything
  ValueKind kind = ValueKind::kText;
  bool repeats = false;
  /// Gets each value (or "" for a flag); throws UsageError.
  std::function<void(const std::string& text)> take;
};

/// Options, operands and subcommands of a program or a subcommand.
struct OptionTable {
  std::string name;  ///< of the program ("torquer-study"), or of the subcommand ("paper")
  std::string summary;
  std::vector<OptionEntry> options;
  std::vector<OptionEntry> operands;
  std::list<OptionTable> subcommands;
  std::vector<std::string> notes;
  std::string group;  ///< of the options declared next
};

/// Text that --help prints for `table`; `words` is the command, such as "torquer-study paper".
std::string HelpText(const OptionTable& table, const std::string& words);

/// A completion script for bash that completes the options, their values and the subcommands.
std::string BashCompletion(const OptionTable& table);

}  // namespace torquer
