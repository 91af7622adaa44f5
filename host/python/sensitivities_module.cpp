// Derivatives of a simulation's states for Python.
#include "host/python/module.h"

namespace py = pybind11;

namespace torquer::python {

namespace {

py::object OrNone(const std::string& text) {
  if (text.empty()) return py::none();
  return py::str(text);
}

py::object OrNone(const Sensitivity& of, const std::vector<Point>& points) {
  if (!of.unknown.empty()) return py::none();
  return ToRows(points);
}

}  // namespace

void AddSensitivity(py::module_& module) {
  py::class_<Sensitivity>(module, "Sensitivity",
                          "Derivatives of the state by a number of the scene.")
      .def("__repr__",
           [](const py::object& self) {
             return Represent(self, "Sensitivity",
                              {"key", "value", "unknown", "unknown_since_s", "first_unknown"});
           })
      .def_readonly("key", &Sensitivity::key)
      .def_readonly("value", &Sensitivity::value,
                    "Number of the key in the scene. For a list of several numbers 1: the "
                    "derivatives are by their common factor.")
      .def_property_readonly(
          "unknown", [](const Sensitivity& self) { return OrNone(self.unknown); },
          "Reason for which the derivatives of the present state are not known; None if they are.")
      .def_property_readonly(
          "unknown_since_s",
          [](const Sensitivity& self) -> py::object {
            if (self.unknown.empty()) return py::none();
            return py::float_(self.unknown_since_s);
          },
          "End of the tick since which they have not been known; None if they are known.")
      .def_property_readonly(
          "first_unknown", [](const Sensitivity& self) { return OrNone(self.first_unknown); },
          "Reason after that tick. Friction and inertia remember the way, so it can be another one "
          "than that of the present state.")
      .def_property_readonly(
          "nodes_mm", [](const Sensitivity& self) { return OrNone(self, self.nodes_mm); },
          "Derivatives of nodes_mm, mm per unit of the key, shape (n, 3); None if not known.")
      .def_property_readonly(
          "tips_mm", [](const Sensitivity& self) { return OrNone(self, self.tips_mm); },
          "Derivatives of tips_mm, shape (instruments, 3); None if not known.")
      .def_property_readonly(
          "readings",
          [](const Sensitivity& self) -> py::object {
            if (!self.unknown.empty()) return py::none();
            return ToReadings(self.readings);
          },
          "Derivatives of readings() per unit of the key, without those of effects that evolve by "
          "themselves; nan: not known. None if no derivative is known.");
}

py::dict SensitivitiesOf(const Simulation& simulation) {
  py::dict out;
  for (const Sensitivity& one : simulation.sensitivities()) out[py::str(one.key)] = py::cast(one);
  return out;
}

}  // namespace torquer::python
