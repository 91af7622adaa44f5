#include "host/support/option_table.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <cctype>
#include <cstddef>
#include <string_view>

namespace torquer {
namespace {

constexpr std::size_t kColumns = 80;
constexpr std::size_t kHelpColumn = 26;

// Breaks text into lines of kColumns, and indents all lines but the first by `indent` columns.
std::string Wrapped(const std::string& text, std::size_t column, std::size_t indent) {
  std::string lines;
  for (std::size_t begin = 0; begin < text.size();) {
    const std::size_t end = std::min(text.find_first_of(" \n", begin), text.size());
    const std::string_view word = std::string_view(text).substr(begin, end - begin);
    if (column > indent && column + 1 + word.size() > kColumns) {
      lines += '\n' + std::string(indent, ' ');
      column = indent;
    } else if (column > indent) {
      lines += ' ';
      ++column;
    }
    lines += word;
    column += word.size();
    begin = end + 1;
    if (end < text.size() && text[end] == '\n') {
      lines += '\n' + std::string(indent, ' ');
      column = indent;
    }
  }
  return lines;
}

std::string HelpOf(const OptionEntry& entry) {
  std::string help = entry.help;
  if (entry.choices.size() > 1) help += fmt::format(": {}", fmt::join(entry.choices, ", "));
  std::vector<std::string> facts;
  if (!entry.range.empty()) facts.push_back(entry.range);
  if (!entry.fallback.empty()) facts.push_back("default " + entry.fallback);
  if (entry.repeats) facts.emplace_back("may be repeated");
  return facts.empty() ? help : fmt::format("{} ({})", help, fmt::join(facts, ", "));
}

std::string Row(const std::string& left, const std::string& right) {
  std::string row = "  " + left;
  if (row.size() + 2 > kHelpColumn) row += '\n';
  const std::size_t line = row.back() == '\n' ? 0 : row.size();
  row += std::string(kHelpColumn - line, ' ');
  return row + Wrapped(right, kHelpColumn, kHelpColumn) + '\n';
}

std::string UsageOf(const OptionTable& table, const std::string& words) {
  std::string usage = "usage: " + words;
  if (!table.subcommands.empty()) usage += " COMMAND";
  usage += " [OPTION]...";
  for (const OptionEntry& operand : table.operands) {
    usage += " " + operand.name + (operand.repeats ? "..." : "");
  }
  return usage + '\n';
}

// Quotes `text` for bash, so that no character has a special meaning.
std::string ShellQuoted(const std::string& text) {
  std::string quoted = "'";
  for (const char character : text) {
    quoted += character == '\'' ? std::string("'\\''") : std::string(1, character);
  }
  return quoted + "'";
}

std::string Words(const std::vector<std::string>& words) {
  return ShellQuoted(fmt::format("{}", fmt::join(words, " ")));
}

// Command that prints the possible values; empty if they are not known.
std::string CandidatesOf(const OptionEntry& entry) {
  if (!entry.choices.empty())
    return fmt::format("compgen -W {} -- \"$current\"", Words(entry.choices));
  switch (entry.kind) {
    case ValueKind::kFile:
      return "compgen -f -- \"$current\"";
    case ValueKind::kFolder:
      return "compgen -d -- \"$current\"";
    case ValueKind::kText:
      break;
  }
  return "";
}

// Body of the completion for one table: completes the value of an option, otherwise words.
std::string CompletionOf(const OptionTable& table, const std::string& indent) {
  std::string body;
  std::vector<std::string> names;
  for (const OptionEntry& option : table.options) {
    names.push_back(option.name);
    if (option.placeholder.empty()) continue;
    const std::string candidates = CandidatesOf(option);
    body += fmt::format("{}  {})\n", indent, option.name);
    if (!candidates.empty()) {
      body += fmt::format("{}    mapfile -t COMPREPLY < <({})\n", indent, candidates);
    }
    body += fmt::format("{}    return\n{}    ;;\n", indent, indent);
  }
  if (!body.empty()) body = fmt::format("{0}case $previous in\n{1}{0}esac\n", indent, body);

  for (const OptionTable& subcommand : table.subcommands) names.push_back(subcommand.name);
  std::string candidates = fmt::format("compgen -W {} -- \"$current\"", Words(names));
  if (!table.operands.empty()) {
    const std::string of_operand = CandidatesOf(table.operands.front());
    if (!of_operand.empty()) candidates += "; " + of_operand;
  }
  return body + fmt::format("{}mapfile -t COMPREPLY < <({})\n", indent, candidates);
}

}  // namespace

std::string HelpText(const OptionTable& table, const std::string& words) {
  std::string text = UsageOf(table, words) + '\n' + Wrapped(table.summary, 0, 0) + '\n';
  if (!table.subcommands.empty()) {
    text += "\nCommands:\n";
    for (const OptionTable& subcommand : table.subcommands) {
      text += Row(subcommand.name, subcommand.summary);
    }
    text +=
        Wrapped(fmt::format("'{} COMMAND --help' lists the options of a command.", words), 0, 0) +
        '\n';
  }
  if (!table.operands.empty()) text += '\n';
  for (const OptionEntry& operand : table.operands) text += Row(operand.name, HelpOf(operand));

  std::vector<std::string> groups;
  for (const OptionEntry& option : table.options) {
    if (std::find(groups.begin(), groups.end(), option.group) == groups.end()) {
      groups.push_back(option.group);
    }
  }
  for (const std::string& group : groups) {
    text += fmt::format("\n{}:\n", group);
    for (const OptionEntry& option : table.options) {
      if (option.group != group) continue;
      const std::string letter = option.letter.empty() ? "" : option.letter + ", ";
      const std::string value = option.placeholder.empty() ? "" : " " + option.placeholder;
      text += Row(letter + option.name + value, HelpOf(option));
    }
  }
  for (const std::string& note : table.notes) text += '\n' + Wrapped(note, 0, 0) + '\n';
  return text;
}

std::string BashCompletion(const OptionTable& table) {
  std::string function = "_" + table.name;
  std::replace(function.begin(), function.end(), '-', '_');
  std::string script = fmt::format(
      "# Completion of {0} for bash. Load it with:  source <({0} --completion bash)\n"
      "{1}() {{\n"
      "  local current=${{COMP_WORDS[COMP_CWORD]}} previous=${{COMP_WORDS[COMP_CWORD - 1]}}\n"
      "  # Bash takes --option=value for three words.\n"
      "  if [[ $current == = ]]; then\n"
      "    current=\n"
      "  elif [[ $previous == = ]]; then\n"
      "    previous=${{COMP_WORDS[COMP_CWORD - 2]}}\n"
      "  fi\n"
      "  COMPREPLY=()\n",
      table.name, function);
  if (!table.subcommands.empty()) {
    script += "  case ${COMP_WORDS[1]} in\n";
    for (const OptionTable& subcommand : table.subcommands) {
      script += fmt::format(
          "    {})\n      if ((COMP_CWORD > 1)); then\n{}        return\n      fi\n      ;;\n",
          subcommand.name, CompletionOf(subcommand, "        "));
    }
    script += "  esac\n";
  }
  return script + CompletionOf(table, "  ") +
         fmt::format("}}\ncomplete -o filenames -F {} {}\n", function, table.name);
}

}  // namespace torquer
