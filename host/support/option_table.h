// Table of a program's options, from which --help and the completion script are printed. Programs
// declare their options through program.h.
#pragma once

#include <functional>
#include <list>
#include <string>
#include <vector>

#include "host/support/program.h"

namespace torquer {

/// One option or operand.
struct OptionEntry {
  std::string name;         ///< "--length"; "LOG" for an operand
  std::string letter;       ///< "-h"; "": none
  std::string placeholder;  ///< stands for the value; empty for a flag
  std::string help;
  std::string group;
  std::string range;                 ///< "0.1 to 1000"; "": none
  std::string fallback;              ///< default, as --help shows it; "": none
  std::vector<std::string> choices;  ///< empty: anything
  ValueKind kind = ValueKind::kText;
  bool repeats = false;
  /// Receives each value (or "" for a flag); throws UsageError.
  std::function<void(const std::string& text)> take;
};

/// Options, operands and subcommands of a program or a subcommand.
struct OptionTable {
  std::string name;  ///< "torquer-study", or "paper" for a subcommand
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
