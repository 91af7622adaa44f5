#include "host/support/program.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <cmath>
#include <csignal>
#include <cstdio>
#include <exception>
#include <iostream>
#include <new>
#include <system_error>
#include <utility>

#include "host/support/error_output.h"
#include "host/support/nearest_name.h"
#include "host/support/number.h"
#include "host/support/option_table.h"
#include "torquer_version.h"

namespace torquer {
namespace {

constexpr char kGeneral[] = "General";

/// Ends the parsing: the program only prints `text`.
struct Print {
  std::string text;
};

std::string Range(double low, double high) { return fmt::format("{:.10g} to {:.10g}", low, high); }

double NumberIn(const std::string& text, double low, double high, const std::string& unit) {
  const std::string remedy = fmt::format("give a number from {} ({})", Range(low, high), unit);
  const std::optional<double> value = ParseNumber(text);
  if (!value) throw UsageError("is not a number; " + remedy);
  if (*value < low || *value > high) throw UsageError("is out of range; " + remedy);
  return *value;
}

OptionEntry NumberEntry(const std::string& name, const std::string& unit, double low, double high,
                        const std::string& help, std::function<void(double)> take) {
  OptionEntry entry;
  entry.name = name;
  entry.placeholder = unit;
  entry.help = help;
  entry.range = Range(low, high);
  entry.take = [low, high, unit, take = std::move(take)](const std::string& text) {
    take(NumberIn(text, low, high, unit));
  };
  return entry;
}

void Add(OptionTable& table, OptionEntry entry) {
  entry.group = table.group;
  table.options.push_back(std::move(entry));
}

std::vector<std::string> NamesOf(const OptionTable& table) {
  std::vector<std::string> names;
  for (const OptionEntry& option : table.options) names.push_back(option.name);
  return names;
}

std::vector<std::string> CommandsOf(const OptionTable& table) {
  std::vector<std::string> names;
  for (const OptionTable& subcommand : table.subcommands) names.push_back(subcommand.name);
  return names;
}

// Passes the texts for one entry to it; CLI11 leaves the check of their number to this.
void TakeAll(const OptionTable& table, const OptionEntry& entry,
             const std::vector<std::string>& texts) {
  if (!entry.repeats && texts.size() > 1) {
    throw UsageError(fmt::format("{} is given {} times; give it once", entry.name, texts.size()));
  }
  const std::vector<std::string> names = NamesOf(table);
  for (const std::string& text : texts) {
    if (std::find(names.begin(), names.end(), text) != names.end()) {
      throw UsageError(fmt::format("{} needs a value ({}), but {} follows", entry.name,
                                   entry.placeholder, text));
    }
    try {
      entry.take(text);
    } catch (const UsageError& error) {
      throw UsageError(fmt::format("{} '{}': {}", entry.name, text, error.what()));
    }
  }
}

// Declares the entries of `table` for CLI11, which returns only texts.
void Declare(const OptionTable& table, CLI::App& app) {
  app.set_help_flag();
  for (const OptionEntry& entry : table.options) {
    const std::string names = entry.letter.empty() ? entry.name : entry.letter + "," + entry.name;
    if (entry.placeholder.empty()) {
      app.add_flag_function(names, [&entry](std::int64_t) { entry.take(""); })
          ->disable_flag_override();
    } else {
      app.add_option_function<std::vector<std::string>>(
             names, [&table, &entry](
                        const std::vector<std::string>& texts) { TakeAll(table, entry, texts); })
          ->allow_extra_args(false);
    }
  }
  for (const OptionEntry& entry : table.operands) {
    CLI::Option* const operand = app.add_option_function<std::vector<std::string>>(
        entry.name, [&entry](const std::vector<std::string>& texts) { TakeAll({}, entry, texts); });
    if (!entry.repeats) operand->expected(1)->allow_extra_args(false);
  }
  for (const OptionTable& subcommand : table.subcommands) {
    Declare(subcommand, *app.add_subcommand(subcommand.name));
  }
}

std::string DidYouMean(const std::string& given, const std::vector<std::string>& known) {
  const std::string near = NearestName(given, known);
  return near.empty() ? "" : fmt::format("; did you mean {}?", near);
}

// Refuses words that are neither options nor operands.
[[noreturn]] void RefuseExtras(const OptionTable& table, const std::vector<std::string>& extras) {
  const auto option = std::find_if(extras.begin(), extras.end(), [](const std::string& word) {
    return word.starts_with('-') && word.size() > 1;
  });
  if (option != extras.end()) {
    const std::string name = option->substr(0, option->find('='));
    throw UsageError(fmt::format("unknown option '{}'{}", name, DidYouMean(name, NamesOf(table))));
  }
  const std::vector<std::string> commands = CommandsOf(table);
  if (commands.empty()) {
    throw UsageError(fmt::format("unexpected argument '{}'", extras.front()));
  }
  const std::string near = NearestName(extras.front(), commands);
  throw UsageError(fmt::format("unknown command '{}'{} There are: {}", extras.front(),
                               near.empty() ? "." : fmt::format("; did you mean {}?", near),
                               fmt::join(commands, ", ")));
}

// Prints the problem, and returns the exit status.
int PrintException(const std::string& program, const std::exception& error) {
  const auto* const of_system = dynamic_cast<const std::system_error*>(&error);
  std::string remedy = of_system == nullptr ? "" : RemedyOf(of_system->code());
  if (dynamic_cast<const std::bad_alloc*>(&error) != nullptr) {
    remedy = RemedyOf(std::make_error_code(std::errc::not_enough_memory));
  }
  if (!remedy.empty()) {
    PrintError("{}: {}; {}\n", program, error.what(), remedy);
    return kExitUserError;
  }
  PrintError("{}: unexpected error: {}; please report it with the command line\n", program,
             error.what());
  return kExitUnexpected;
}

}  // namespace

// --- options -------------------------------------------------------------------------------------

void Options::Group(const std::string& heading) { table_.group = heading; }

void Options::Flag(const std::string& name, bool& value, const std::string& help) {
  OptionEntry entry;
  entry.name = name;
  entry.help = help;
  entry.take = [&value](const std::string&) { value = true; };
  Add(table_, std::move(entry));
}

void Options::Text(const std::string& name, const std::string& placeholder, std::string& value,
                   const std::string& help, ValueKind kind) {
  OptionEntry entry;
  entry.name = name;
  entry.placeholder = placeholder;
  entry.help = help;
  entry.fallback = value;
  entry.kind = kind;
  entry.take = [&value](const std::string& text) { value = text; };
  Add(table_, std::move(entry));
}

void Options::Texts(const std::string& name, const std::string& placeholder,
                    std::vector<std::string>& values, const std::string& help) {
  OptionEntry entry;
  entry.name = name;
  entry.placeholder = placeholder;
  entry.help = help;
  entry.kind = ValueKind::kFile;
  entry.repeats = true;
  entry.take = [&values](const std::string& text) { values.push_back(text); };
  Add(table_, std::move(entry));
}

void Options::Choice(const std::string& name, const std::string& placeholder,
                     const std::vector<std::string>& choices, std::string& value,
                     const std::string& help) {
  OptionEntry entry;
  entry.name = name;
  entry.placeholder = placeholder;
  entry.help = help;
  entry.fallback = value;
  entry.choices = choices;
  entry.take = [&value, choices](const std::string& text) {
    if (std::find(choices.begin(), choices.end(), text) == choices.end()) {
      throw UsageError(
          fmt::format("is not one of {}{}", fmt::join(choices, ", "), DidYouMean(text, choices)));
    }
    value = text;
  };
  Add(table_, std::move(entry));
}

void Options::Number(const std::string& name, const std::string& unit, double& value, double low,
                     double high, const std::string& help) {
  OptionEntry entry =
      NumberEntry(name, unit, low, high, help, [&value](double number) { value = number; });
  entry.fallback = fmt::format("{:.10g}", value);
  Add(table_, std::move(entry));
}

void Options::Number(const std::string& name, const std::string& unit, std::optional<double>& value,
                     double low, double high, const std::string& help) {
  OptionEntry entry =
      NumberEntry(name, unit, low, high, help, [&value](double number) { value = number; });
  if (value) entry.fallback = fmt::format("{:.10g}", *value);
  Add(table_, std::move(entry));
}

void Options::Numbers(const std::string& name, const std::string& unit, std::vector<double>& values,
                      double low, double high, const std::string& help) {
  OptionEntry entry = NumberEntry(name, unit, low, high, help,
                                  [&values](double number) { values.push_back(number); });
  entry.repeats = true;
  Add(table_, std::move(entry));
}

void Options::AddInteger(const std::string& name, const std::string& placeholder,
                         const std::string& fallback, std::int64_t low, std::int64_t high,
                         const std::string& help, std::function<void(std::int64_t)> take) {
  OptionEntry entry;
  entry.name = name;
  entry.placeholder = placeholder;
  entry.help = help;
  entry.range = fmt::format("{} to {}", low, high);
  entry.fallback = fallback;
  entry.take = [low, high, take = std::move(take)](const std::string& text) {
    const std::string remedy = fmt::format("give a whole number from {} to {}", low, high);
    const std::optional<double> value = ParseNumber(text);
    if (!value || *value != std::floor(*value)) {
      throw UsageError("is not a whole number; " + remedy);
    }
    if (*value < static_cast<double>(low) || *value > static_cast<double>(high)) {
      throw UsageError("is out of range; " + remedy);
    }
    take(static_cast<std::int64_t>(*value));
  };
  Add(table_, std::move(entry));
}

void Options::Custom(const std::string& name, const std::string& placeholder,
                     const std::string& help, std::function<void(const std::string& text)> take) {
  OptionEntry entry;
  entry.name = name;
  entry.placeholder = placeholder;
  entry.help = help;
  entry.repeats = true;
  entry.take = std::move(take);
  Add(table_, std::move(entry));
}

void Options::Operand(const std::string& name, std::string& value, const std::string& help,
                      ValueKind kind) {
  OptionEntry entry;
  entry.name = name;
  entry.help = help;
  entry.kind = kind;
  entry.take = [&value](const std::string& text) { value = text; };
  table_.operands.push_back(std::move(entry));
}

void Options::Operands(const std::string& name, std::vector<std::string>& values,
                       const std::string& help, ValueKind kind) {
  OptionEntry entry;
  entry.name = name;
  entry.help = help;
  entry.kind = kind;
  entry.repeats = true;
  entry.take = [&values](const std::string& text) { values.push_back(text); };
  table_.operands.push_back(std::move(entry));
}

// --- program -------------------------------------------------------------------------------------

struct Program::Impl {
  OptionTable table;
  Options options{table};
  std::list<Options> subcommand_options;
  std::string subcommand;

  const OptionTable& Given() const {
    for (const OptionTable& each : table.subcommands) {
      if (each.name == subcommand) return each;
    }
    return table;
  }
  std::string Words() const {
    return subcommand.empty() ? table.name : table.name + " " + subcommand;
  }
};

Program::Program(const std::string& name, const std::string& summary)
    : impl_(std::make_unique<Impl>()) {
  impl_->table.name = name;
  impl_->table.summary = summary;
  impl_->table.group = "Options";
}

Program::~Program() = default;

Options& Program::options() { return impl_->options; }

Options& Program::Subcommand(const std::string& name, const std::string& summary) {
  OptionTable& table = impl_->table.subcommands.emplace_back();
  table.name = name;
  table.summary = summary;
  table.group = "Options";
  return impl_->subcommand_options.emplace_back(table);
}

const std::string& Program::subcommand() const { return impl_->subcommand; }

void Program::Note(const std::string& paragraph) { impl_->table.notes.push_back(paragraph); }

int Program::ParseAndRun(int argc, char** argv, const std::function<int()>& run) {
  OptionTable& table = impl_->table;
  const auto add_help = [](OptionTable& to, const std::string& words) {
    to.group = kGeneral;
    OptionEntry help;
    help.name = "--help";
    help.letter = "-h";
    help.help = "print this help";
    help.take = [&to, words](const std::string&) { throw Print{HelpText(to, words)}; };
    Add(to, std::move(help));
  };
  add_help(table, table.name);
  for (OptionTable& each : table.subcommands) add_help(each, table.name + " " + each.name);
  OptionEntry version;
  version.name = "--version";
  version.help = "print the version";
  version.take = [&table](const std::string&) {
    throw Print{fmt::format("{} {}\n", table.name, kVersion)};
  };
  Add(table, std::move(version));
  std::string shell;
  impl_->options.Choice("--completion", "SHELL", {"bash"}, shell,
                        fmt::format("print a completion script for bash; load it with: "
                                    "source <({} --completion bash)",
                                    table.name));

  CLI::App app;
  Declare(table, app);
  std::vector<std::string> words(argv + 1, argv + argc);
  std::reverse(words.begin(), words.end());  // CLI11 expects this order
  // Stores the subcommand that was parsed before an error, so that messages refer to its help.
  const auto note_subcommand = [&] {
    for (const CLI::App* given : app.get_subcommands()) impl_->subcommand = given->get_name();
  };
  try {
    app.parse(std::move(words));
    note_subcommand();
  } catch (const CLI::ExtrasError&) {
    note_subcommand();
    RefuseExtras(impl_->Given(), app.remaining(true));
  } catch (const CLI::ArgumentMismatch& mismatch) {
    // The library's message begins with the option: "--length: ..." if its value is missing. For a
    // flag with a value it is "json was given ...".
    note_subcommand();
    const std::string message = mismatch.what();
    const std::string name = message.substr(0, message.find_first_of(": "));
    for (const OptionEntry& option : impl_->Given().options) {
      if (option.name != name && option.name != "--" + name) continue;
      if (option.placeholder.empty()) throw UsageError(option.name + " takes no value");
      throw UsageError(fmt::format("{} needs a value ({})", name, option.placeholder));
    }
    throw UsageError(message);
  } catch (const CLI::Error& error) {
    throw UsageError(error.what());
  } catch (const UsageError&) {
    note_subcommand();
    throw;
  }
  if (!shell.empty()) throw Print{BashCompletion(table)};
  if (!table.subcommands.empty() && impl_->subcommand.empty()) {
    throw UsageError(
        fmt::format("no command given. There are: {}", fmt::join(CommandsOf(table), ", ")));
  }
  return run();
}

int Program::Main(int argc, char** argv, const std::function<int()>& run) {
  int status = kExitSuccess;
  const std::string& name = impl_->table.name;
  OccupyStandardStreams();
  // Then the file size limit causes an error of the write, as a full disk does.
  std::signal(SIGXFSZ, SIG_IGN);
  try {
    status = ParseAndRun(argc, argv, run);
  } catch (const Print& print) {
    std::fputs(print.text.c_str(), stdout);
  } catch (const UsageError& error) {
    PrintError("{}: {}\nSee '{} --help'.\n", name, error.what(), impl_->Words());
    status = kExitUserError;
  } catch (const UserError& error) {
    PrintError("{}: {}\n", name, error.what());
    status = kExitUserError;
  } catch (const std::exception& error) {
    status = PrintException(name, error);
  }
  std::cout.flush();
  const bool written = std::fflush(stdout) == 0 && std::ferror(stdout) == 0 && !std::cout.fail();
  if (!written && status == kExitSuccess) {
    PrintError("{}: standard output cannot be written; is the disk full?\n", name);
    status = kExitUserError;
  }
  return status;
}

}  // namespace torquer
