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

/// Exit statuses of all programs. A program stopped by Ctrl-C where that means to give up ends with
/// kExitGivenUp, as shells have it.
enum ExitStatus : int {
  kExitSuccess = 0,
  kExitFailure = 1,     ///< it ran, and what it checks or makes failed; --help says what that is
  kExitUserError = 2,   ///< the command line, a file, a device or a limit: UserError
  kExitUnexpected = 3,  ///< any other exception: a defect
  kExitGivenUp = 130,
};

/// The command line cannot be used. Its message ends with a reference to --help.
class UsageError : public UserError {
 public:
  using UserError::UserError;
};

/// Completions for a value: nothing, files or folders.
enum class ValueKind { kText, kFile, kFolder };

struct OptionTable;

/// The options of a program, or of one of its subcommands. Each call declares one option; the
/// values that the variables have then are the defaults that --help names. An option is given at
/// most once, unless said otherwise. `help` says in a few words what the option does, without a
/// full stop; `placeholder` stands for the value in --help, such as FILE or MM.
class Options {
 public:
  explicit Options(OptionTable& table) : table_(table) {}

  /// The heading in --help of the options that follow.
  void Group(const std::string& heading);

  /// `name` alone sets `value`.
  void Flag(const std::string& name, bool& value, const std::string& help);

  void Text(const std::string& name, const std::string& placeholder, std::string& value,
            const std::string& help, ValueKind kind = ValueKind::kText);
  /// May be given several times.
  void Texts(const std::string& name, const std::string& placeholder,
             std::vector<std::string>& values, const std::string& help);
  /// One of `choices`.
  void Choice(const std::string& name, const std::string& placeholder,
              const std::vector<std::string>& choices, std::string& value, const std::string& help);

  /// A number in [low, high]; `unit` is also its placeholder.
  void Number(const std::string& name, const std::string& unit, double& value, double low,
              double high, const std::string& help);
  void Number(const std::string& name, const std::string& unit, std::optional<double>& value,
              double low, double high, const std::string& help);
  /// The same; may be given several times.
  void Numbers(const std::string& name, const std::string& unit, std::vector<double>& values,
               double low, double high, const std::string& help);

  /// A whole number in [low, high], which `Whole` can hold.
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

  /// `take` gets each text that is given; it throws UsageError with what is wrong and the remedy,
  /// which the option's name and the text are put before.
  void Custom(const std::string& name, const std::string& placeholder, const std::string& help,
              std::function<void(const std::string& text)> take);

  /// The next word that is no option.
  void Operand(const std::string& name, std::string& value, const std::string& help,
               ValueKind kind = ValueKind::kFile);
  /// All further ones.
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
/// Every program has --help, --version and --completion bash besides.
class Program {
 public:
  /// `name` as in the folder of programs; `summary` says in a sentence or two what it does.
  Program(const std::string& name, const std::string& summary);
  ~Program();
  Program(const Program&) = delete;
  Program& operator=(const Program&) = delete;

  Options& options();

  /// Declares a subcommand; a program that has some needs one of them on its command line.
  /// `summary` is one line. The reference stays valid.
  Options& Subcommand(const std::string& name, const std::string& summary);
  /// The name of the one given; "" without subcommands.
  const std::string& subcommand() const;

  /// Adds a paragraph at the end of --help, such as the meaning of exit status 1.
  void Note(const std::string& paragraph);

  /// Parses the command line, prints what it asks for, or returns what `run` returns. Prints
  /// exceptions, and what could not be written to standard output, to standard error and returns
  /// their ExitStatus.
  int Main(int argc, char** argv, const std::function<int()>& run);

 private:
  struct Impl;
  int ParseAndRun(int argc, char** argv, const std::function<int()>& run);

  std::unique_ptr<Impl> impl_;
};

}  // namespace torquer
