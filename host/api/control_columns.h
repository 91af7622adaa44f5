// Columns of a script that set the X-ray system, the table and the injections.
#pragma once

#include <optional>
#include <span>
#include <string>
#include <vector>

#include "host/api/torquer/torquer.h"

namespace torquer {

/// A column by its name, with its values.
struct ControlColumn {
  const char* name;
  double lowest = 0;
  double highest = 1;
  std::optional<double> as_scene;  ///< value beyond that range that stands for the scene's
  bool whole = false;              ///< 0 or 1 only
  std::vector<std::string> words;  ///< instead of numbers; the first one is value 0
  void (*take)(double value, Command& command);

  /// Valid values, as in "0 or 1", "plain, subtraction", "1 to 60, or 0 for the scene's value".
  std::string Values() const;
  /// Value of a cell with one of `words`; nullopt for other text.
  std::optional<double> ValueOf(const std::string& word) const;
  bool Allows(double value) const;
};

/// All of them, in the order of the documents.
std::span<const ControlColumn> ControlColumns();

}  // namespace torquer
