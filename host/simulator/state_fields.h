// What is known of a state after a row of a script, field by field.
#pragma once

#include <cstdint>
#include <functional>
#include <string>
#include <variant>
#include <vector>

#include "host/simulator/row_run.h"
#include "host/simulator/simulation.h"

namespace torquer::simulator {

/// A state, and what it cost.
struct StateRow {
  Simulation& simulation;
  double time_s = 0;  ///< as the script has it
  RowRun::Cost cost;
  double solve_us = 0;
};

/// The values of a node follow one another.
using StateValue = std::variant<double, std::int64_t, std::uint64_t, std::vector<double>>;

struct StateField {
  std::string name;        ///< as host/simulator/README.md explains it
  std::string unit;        ///< "mm", "mN/mm"; "1" for a number without one
  std::string type;        ///< "f8", "i8" or "u8", of 8 bytes each
  int values_of_node = 0;  ///< 1 or 3; 0: one value a state
  std::function<StateValue(const StateRow& row)> get;
};

/// The fields of a scene's states, in the order of their names. `wanted`: names with commas
/// between; empty: all. Throws UserError with the list of names where one of them is no field, or
/// is there twice.
std::vector<StateField> StateFields(const Simulation& simulation, const std::string& wanted);

}  // namespace torquer::simulator
