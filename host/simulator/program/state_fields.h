// What is known of a state after a row of a script, field by field.
#pragma once

#include <cstdint>
#include <functional>
#include <optional>
#include <string>
#include <variant>
#include <vector>

#include "host/api/torquer/torquer.h"

namespace torquer::program {

/// What a row cost.
struct RowCost {
  StepReport row;
  StepReport last_tick;
  double solve_us = 0;
};

/// A state after a row.
class StateRow {
 public:
  /// `time_s` as the script has it. `simulation` must outlive this, and stay as it is.
  StateRow(Simulation& simulation, double time_s, const RowCost& cost)
      : simulation_(simulation), time_s_(time_s), cost_(cost) {}

  Simulation& simulation() const { return simulation_; }
  double time_s() const { return time_s_; }
  const RowCost& cost() const { return cost_; }
  /// Of the simulation; looked for once, and only where a field needs them.
  const std::vector<InstrumentState>& instruments() const;
  const std::vector<Reading>& readings() const;
  const Forces& forces() const;

 private:
  Simulation& simulation_;
  const double time_s_;
  const RowCost cost_;
  mutable std::optional<std::vector<InstrumentState>> instruments_;
  mutable std::optional<std::vector<Reading>> readings_;
  mutable std::optional<Forces> forces_;
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

}  // namespace torquer::program
