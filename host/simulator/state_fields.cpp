#include "host/simulator/state_fields.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <array>
#include <string_view>
#include <type_traits>
#include <utility>

#include "host/support/error.h"
#include "host/support/nearest_name.h"

namespace torquer::simulator {

namespace {

// A name ends with its unit, in which "_" stands for "times" but after a load or a speed.
std::string UnitOf(std::string_view name) {
  constexpr std::array<std::pair<std::string_view, std::string_view>, 16> kUnits = {{
      {"_load_mN_mm", "mN/mm"},
      {"_speed_mm_s", "mm/s"},
      {"_mN_mm", "mN mm"},
      {"_Gy_cm2", "Gy cm2"},
      {"_mNs", "mN s"},
      {"_mN", "mN"},
      {"_mm", "mm"},
      {"_um", "um"},
      {"_rad", "rad"},
      {"_mJ", "mJ"},
      {"_us", "us"},
      {"_s", "s"},
      {"_mGy", "mGy"},
      {"_mL", "mL"},
      {"_mg", "mg"},
      {"_kPa", "kPa"},
  }};
  for (const auto& [ending, unit] : kUnits) {
    if (name.ends_with(ending)) return std::string(unit);
  }
  return "1";
}

class List {
 public:
  // The type is that of what is got.
  template <class Get>
  void Add(const std::string& name, Get get) {
    using Value = std::invoke_result_t<Get, const StateRow&>;
    const char* const type = std::is_floating_point_v<Value> ? "f8"
                             : std::is_signed_v<Value>       ? "i8"
                                                             : "u8";
    fields_.push_back({name, UnitOf(name), type, 0, std::move(get)});
  }
  template <class Get>
  void AddNodes(const std::string& name, int values_of_node, Get get) {
    fields_.push_back({name, UnitOf(name), "f8", values_of_node, std::move(get)});
  }
  std::vector<StateField>& fields() { return fields_; }

 private:
  std::vector<StateField> fields_;
};

std::vector<double> Flat(const std::vector<Eigen::Vector3d>& points, double scale) {
  std::vector<double> values;
  values.reserve(3 * points.size());
  for (const Eigen::Vector3d& x : points) {
    for (int axis = 0; axis < 3; ++axis) values.push_back(scale * x[axis]);
  }
  return values;
}

// The same as on the bus, of every node.
void AddForces(List& list) {
  list.AddNodes("contact_force_mN", 3,
                [](const StateRow& row) { return Flat(row.simulation.forces()->contact_N, 1e3); });
  const auto add = [&list](const std::string& name, std::vector<double> InternalForces::*values) {
    list.AddNodes(name, 1, [values](const StateRow& row) {
      std::vector<double> scaled = row.simulation.forces()->*values;
      for (double& value : scaled) value *= 1e3;
      return scaled;
    });
  };
  add("line_load_mN_mm", &InternalForces::line_load_N_mm);
  add("tension_mN", &InternalForces::tension_N);
  add("bending_mN_mm", &InternalForces::bending_mJ);
  add("twisting_mN_mm", &InternalForces::twisting_mJ);
}

void AddInstrument(List& list, const std::string& name, int k) {
  list.Add(name + ".insertion_mm",
           [k](const StateRow& row) { return row.simulation.state().places()[k].insertion_mm; });
  list.Add(name + ".rotation_rad",
           [k](const StateRow& row) { return row.simulation.state().places()[k].rotation_rad; });
  list.Add(name + ".carried_mm",
           [k](const StateRow& row) { return row.simulation.report().carried[k].insertion_mm; });
  list.Add(name + ".carried_rad",
           [k](const StateRow& row) { return row.simulation.report().carried[k].rotation_rad; });
}

std::vector<StateField> AllFields(const Simulation& simulation) {
  using Row = const StateRow&;
  List list;
  list.Add("time_s", [](Row row) { return row.time_s; });
  list.AddNodes("nodes_mm", 3, [](Row row) { return Flat(row.simulation.state().nodes(), 1); });
  list.Add("energy_mJ", [](Row row) { return row.simulation.report().energy_mJ; });
  list.Add("dissipated_mJ", [](Row row) { return row.simulation.report().dissipated_mJ; });
  list.Add("residual", [](Row row) { return row.simulation.report().residual; });
  list.Add("discretization_error_mm",
           [](Row row) { return row.simulation.DiscretizationErrorMm(); });
  list.Add("solver_error_mm", [](Row row) { return row.simulation.SolverErrorMm(); });
  list.Add("max_penetration_um",
           [](Row row) { return 1e3 * row.simulation.report().max_penetration_mm; });
  list.Add("iterations", [](Row row) { return std::int64_t{row.cost.iterations}; });
  list.Add("work", [](Row row) { return std::int64_t{row.cost.work}; });
  list.Add("solve_us", [](Row row) { return row.solve_us; });
  list.Add("state_hash", [](Row row) { return std::uint64_t{row.simulation.state_hash()}; });
  list.Add("status", [](Row row) { return std::int64_t{row.simulation.status()}; });
  int instrument = 0;
  for (const auto& each : simulation.scene().instruments()) {
    AddInstrument(list, each.name, instrument++);
  }
  const std::vector<effects::Reading> readings = simulation.Readings();
  for (std::size_t k = 0; k < readings.size(); ++k) {
    list.Add(readings[k].name, [k](Row row) { return row.simulation.Readings()[k].value; });
  }
  if (simulation.forces() != nullptr) AddForces(list);
  std::sort(list.fields().begin(), list.fields().end(),
            [](const StateField& a, const StateField& b) { return a.name < b.name; });
  return std::move(list.fields());
}

}  // namespace

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
      throw UserError(fmt::format("--fields: {} is there twice; name each field once", name));
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

}  // namespace torquer::simulator
