// Fields of a state after a row of a script.
#pragma once

#include <cstdint>
#include <functional>
#include <optional>
#include <string>
#include <variant>
#include <vector>

#include "host/api/torquer/torquer.h"

namespace torquer::program {

/// Work and time of a row.
struct RowCost {
  StepReport row;
  StepReport last_tick;
  double solve_us = 0;
};

/// State after a row; the fields read their values from it.
class StateRow {
 public:
  /// `time_s`: time in the script. `simulation` must outlive this and must not change meanwhile.
  StateRow(Simulation& simulation, double time_s, const RowCost& cost)
      : simulation_(simulation), time_s_(time_s), cost_(cost) {}

  Simulation& simulation() const { return simulation_; }
  double time_s() const { return time_s_; }
  const RowCost& cost() const { return cost_; }
  /// Values of the simulation, read at the first call only.
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

/// A vector holds the values node after node.
using StateValue = std::variant<double, std::int64_t, std::uint64_t, std::vector<double>>;

struct StateField {
  std::string name;        ///< see host/simulator/README.md
  std::string unit;        ///< "mm", "mN/mm"; "1": no unit
  std::string type;        ///< "f8", "i8" or "u8", of 8 bytes each
  int values_of_node = 0;  ///< 1 or 3; 0: one value for each state
  std::function<StateValue(const StateRow& row)> get;
};

/// Fields of a scene's states, in the order of their names. `wanted`: names with commas between;
/// empty: all. Throws UserError for an unknown name, with the list of names, and for a repeated
/// name.
std::vector<StateField> StateFields(const Simulation& simulation, const std::string& wanted);

}  // namespace torquer::program
