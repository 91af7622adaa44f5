#include "host/simulator/program/state_fields.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <array>
#include <string_view>
#include <type_traits>
#include <utility>

#include "host/simulator/wire_status.h"
#include "host/support/error.h"
#include "host/support/nearest_name.h"
#include "host/support/unit_of_name.h"

namespace torquer::program {

namespace {

class List {
 public:
  // The result type of `get` decides the field's type.
  template <class Get>
  void Add(const std::string& name, Get get) {
    using Value = std::invoke_result_t<Get, const StateRow&>;
    const char* const type = std::is_floating_point_v<Value> ? "f8"
                             : std::is_signed_v<Value>       ? "i8"
                                                             : "u8";
    fields_.push_back({name, std::string(UnitOfName(name)), type, 0, std::move(get)});
  }
  template <class Get>
  void AddNodes(const std::string& name, int values_of_node, Get get) {
    fields_.push_back({name, std::string(UnitOfName(name)), "f8", values_of_node, std::move(get)});
  }
  std::vector<StateField>& fields() { return fields_; }

 private:
  std::vector<StateField> fields_;
};

std::vector<double> NodesOf(const StateRow& row) {
  const double* const nodes_mm = row.simulation().nodes_mm();
  return {nodes_mm, nodes_mm + 3 * row.simulation().node_count()};
}

std::vector<double> ContactForces(const StateRow& row) {
  std::vector<double> values;
  values.reserve(3 * row.forces().contact_mN.size());
  for (const Point& force : row.forces().contact_mN) {
    values.insert(values.end(), force.begin(), force.end());
  }
  return values;
}

// Same forces as on the bus, for every node.
void AddForces(List& list) {
  list.AddNodes("contact_force_mN", 3, ContactForces);
  const auto add = [&list](const std::string& name, std::vector<double> Forces::*values) {
    list.AddNodes(name, 1, [values](const StateRow& row) { return row.forces().*values; });
  };
  add("line_load_mN_mm", &Forces::line_load_mN_mm);
  add("tension_mN", &Forces::tension_mN);
  add("bending_mN_mm", &Forces::bending_mN_mm);
  add("twisting_mN_mm", &Forces::twisting_mN_mm);
}

// Nodes along one instrument, for scenes whose instruments do not share one curve.
std::vector<double> NodesAlong(const StateRow& row, std::size_t instrument) {
  std::vector<double> values;
  for (const Point& node : row.simulation().InstrumentNodesMm(instrument)) {
    values.insert(values.end(), node.begin(), node.end());
  }
  return values;
}

void AddInstrument(List& list, const std::string& name, std::size_t k) {
  const auto add = [&](const std::string& what, Hand InstrumentState::*hand, double Hand::*value) {
    list.Add(name + what, [=](const StateRow& row) { return row.instruments()[k].*hand.*value; });
  };
  add(".insertion_mm", &InstrumentState::hand, &Hand::insertion_mm);
  add(".rotation_rad", &InstrumentState::hand, &Hand::rotation_rad);
  add(".carried_mm", &InstrumentState::carried, &Hand::insertion_mm);
  add(".carried_rad", &InstrumentState::carried, &Hand::rotation_rad);
}

// Status bits as on the bus.
std::int64_t StatusOf(const StateRow& row) {
  return simulator::StatusBits(row.cost().last_tick, row.simulation().outside_lumen());
}

std::vector<StateField> AllFields(const Simulation& simulation) {
  using Row = const StateRow&;
  List list;
  list.Add("time_s", [](Row row) { return row.time_s(); });
  list.AddNodes("nodes_mm", 3, NodesOf);
  list.Add("energy_mJ", [](Row row) { return row.simulation().energy_mJ(); });
  list.Add("dissipated_mJ", [](Row row) { return row.simulation().dissipated_mJ(); });
  list.Add("residual", [](Row row) { return row.simulation().residual(); });
  list.Add("discretization_error_mm",
           [](Row row) { return row.simulation().DiscretizationErrorMm(); });
  list.Add("solver_error_mm", [](Row row) { return row.simulation().SolverErrorMm(); });
  list.Add("max_penetration_um",
           [](Row row) { return 1e3 * row.simulation().max_penetration_mm(); });
  list.Add("iterations", [](Row row) { return std::int64_t{row.cost().row.iterations}; });
  list.Add("work", [](Row row) { return std::int64_t{row.cost().row.work}; });
  list.Add("solve_us", [](Row row) { return row.cost().solve_us; });
  list.Add("state_hash", [](Row row) { return row.simulation().state_hash(); });
  list.Add("status", StatusOf);
  const std::vector<InstrumentInfo>& instruments = simulation.scene().instruments();
  const std::vector<std::string> effects = simulation.scene().effects();
  const bool curves =
      std::find(effects.begin(), effects.end(), "clearance") != effects.end() ||
      std::any_of(instruments.begin(), instruments.end(),
                  [](const InstrumentInfo& instrument) { return instrument.is_beside; });
  for (std::size_t k = 0; k < instruments.size(); ++k) {
    AddInstrument(list, instruments[k].name, k);
    if (!curves) continue;
    list.AddNodes(instruments[k].name + ".nodes_mm", 3,
                  [k](const StateRow& row) { return NodesAlong(row, k); });
  }
  const std::vector<Reading> readings = simulation.readings();
  for (std::size_t k = 0; k < readings.size(); ++k) {
    list.Add(readings[k].name, [k](Row row) { return row.readings()[k].value; });
  }
  if (std::find(effects.begin(), effects.end(), "internal_forces") != effects.end()) {
    AddForces(list);
  }
  std::sort(list.fields().begin(), list.fields().end(),
            [](const StateField& a, const StateField& b) { return a.name < b.name; });
  return std::move(list.fields());
}

}  // namespace

const std::vector<InstrumentState>& StateRow::instruments() const {
  if (!instruments_) instruments_ = simulation_.instruments();
  return *instruments_;
}

const std::vector<Reading>& StateRow::readings() const {
  if (!readings_) readings_ = simulation_.readings();
  return *readings_;
}

const Forces& StateRow::forces() const {
  if (!forces_) forces_ = simulation_.forces();
  return *forces_;
}

std::vector<StateField> StateFields(const Simulation& simulation, const std::string& wanted) {
  std::vector<StateField> all = AllFields(simulation);
  if (wanted.empty()) return all;
  std::vector<std::string> known;
  for (const StateField& field : all) known.push_back(field.name);
  std::vector<std::string> names;
  for (std::size_t begin = 0; begin <= wanted.size();) {
    const std::size_t end = std::min(wanted.find(',', begin), wanted.size());
    const std::string name = wanted.substr(begin, end - begin);
    begin = end + 1;
    if (std::find(names.begin(), names.end(), name) != names.end()) {
      throw UserError(fmt::format("--fields: {} is given twice; name each field once", name));
    }
    names.push_back(name);
    if (std::find(known.begin(), known.end(), name) != known.end()) continue;
    const std::string near = NearestName(name, known);
    throw UserError(fmt::format(
        "--fields: a state of {} has no field '{}'; {}there are: {}", simulation.scene().path(),
        name, near.empty() ? "" : "did you mean " + near + "? ", fmt::join(known, ", ")));
  }
  std::erase_if(all, [&names](const StateField& field) {
    return std::find(names.begin(), names.end(), field.name) == names.end();
  });
  return all;
}

}  // namespace torquer::program
