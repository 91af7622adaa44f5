// Common parts of every program: the command line (parsed by CLI11), --help, --version,
// --completion, error messages and exit statuses.
#pragma once

#include <concepts>
#include <cstdint>
#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "host/support/error.h"

namespace torquer {

/// Exit statuses of all programs. kExitGivenUp is for a program that Ctrl-C stops before its end,
/// as in shells.
enum ExitStatus : int {
  kExitSuccess = 0,
  kExitFailure = 1,     ///< it ran, but its check or work failed; --help explains it
  kExitUserError = 2,   ///< the command line, a file, a device or a limit: UserError
  kExitUnexpected = 3,  ///< any other exception: a defect
  kExitGivenUp = 130,
};

/// The command line cannot be used. Its message ends with a reference to --help.
class UsageError : public UserError {
 public:
  using UserError::UserError;
};

/// Completions for a value: none, files or folders.
enum class ValueKind { kText, kFile, kFolder };

struct OptionTable;

/// Options of a program or a subcommand. Each call declares one option; the present values of the
/// variables are the defaults in --help. An option is given at most once, unless stated otherwise.
/// `help` describes the option in a few words without a full stop. `placeholder` stands for the
/// value in --help, such as FILE or MM.
class Options {
 public:
  explicit Options(OptionTable& table) : table_(table) {}

  /// Heading in --help for the options that follow.
  void Group(const std::string& heading);

  /// The option, which takes no value, sets `value`.
  void Flag(const std::string& name, bool& value, const std::string& help);

  void Text(const std::string& name, const std::string& placeholder, std::string& value,
            const std::string& help, ValueKind kind = ValueKind::kText);
  /// The option may be given several times.
  void Texts(const std::string& name, const std::string& placeholder,
             std::vector<std::string>& values, const std::string& help);
  /// The value must be one of `choices`.
  void Choice(const std::string& name, const std::string& placeholder,
              const std::vector<std::string>& choices, std::string& value, const std::string& help);

  /// Number in [low, high]; `unit` is also the placeholder.
  void Number(const std::string& name, const std::string& unit, double& value, double low,
              double high, const std::string& help);
  void Number(const std::string& name, const std::string& unit, std::optional<double>& value,
              double low, double high, const std::string& help);
  /// Same as Number, but the option may be given several times.
  void Numbers(const std::string& name, const std::string& unit, std::vector<double>& values,
               double low, double high, const std::string& help);

  /// Integer in [low, high], which `Whole` can hold.
  template <std::integral Whole>
  void Integer(const std::string& name, const std::string& placeholder, Whole& value,
               std::int64_t low, std::int64_t high, const std::string& help) {
    AddInteger(name, placeholder, std::to_string(value), low, high, help,
               [&value](std::int64_t number) { value = static_cast<Whole>(number); });
  }
  template <std::integral Whole>
  void Integer(const std::string& name, const std::string& placeholder, std::optional<Whole>& value,
               std::int64_t low, std::int64_t high, const std::string& help) {
    AddInteger(name, placeholder, value ? std::to_string(*value) : "", low, high, help,
               [&value](std::int64_t number) { value = static_cast<Whole>(number); });
  }

  /// `take` receives each given text. It throws UsageError with the problem and the remedy; the
  /// caller adds the option's name and the text.
  void Custom(const std::string& name, const std::string& placeholder, const std::string& help,
              std::function<void(const std::string& text)> take);

  /// Next word that is not an option.
  void Operand(const std::string& name, std::string& value, const std::string& help,
               ValueKind kind = ValueKind::kFile);
  /// All further operands.
  void Operands(const std::string& name, std::vector<std::string>& values, const std::string& help,
                ValueKind kind = ValueKind::kFile);

 private:
  void AddInteger(const std::string& name, const std::string& placeholder,
                  const std::string& fallback, std::int64_t low, std::int64_t high,
                  const std::string& help, std::function<void(std::int64_t)> take);

  OptionTable& table_;
};

/// A program: declare its options, then return what Main() returns from main().
///
/// Every program also has --help, --version and --completion bash.
class Program {
 public:
  /// `name`: file name of the program; `summary`: its purpose in a sentence or two.
  Program(const std::string& name, const std::string& summary);
  ~Program();
  Program(const Program&) = delete;
  Program& operator=(const Program&) = delete;

  Options& options();

  /// Declares a subcommand; a program that has some needs one of them on its command line.
  /// `summary` is one line. The reference stays valid.
  Options& Subcommand(const std::string& name, const std::string& summary);
  /// Name of the given subcommand; "" without subcommands.
  const std::string& subcommand() const;

  /// Adds a paragraph at the end of --help, such as the meaning of exit status 1.
  void Note(const std::string& paragraph);

  /// Parses the command line, prints the requested text, or returns the result of `run`. Exceptions
  /// and failures of standard output are printed to standard error. Then it returns their
  /// ExitStatus.
  int Main(int argc, char** argv, const std::function<int()>& run);

 private:
  struct Impl;
  int ParseAndRun(int argc, char** argv, const std::function<int()>& run);

  std::unique_ptr<Impl> impl_;
};

}  // namespace torquer
