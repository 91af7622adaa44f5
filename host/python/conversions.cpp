// Values between Python and torquer.h, for all sources of torquer._torquer.
#include <cstring>
#include <initializer_list>
#include <string>
#include <string_view>
#include <vector>

#include "host/python/module.h"
#include "host/support/nearest_name.h"
#include "host/support/printable_text.h"
#include "host/support/unit_of_name.h"

namespace py = pybind11;

namespace torquer::python {

void RequireColumns(const Rows& rows, const char* name, int columns) {
  if (rows.ndim() == 2 && rows.shape(1) == columns) return;
  std::string shape;
  for (py::ssize_t k = 0; k < rows.ndim(); ++k) {
    shape += (k == 0 ? "" : ", ") + std::to_string(rows.shape(k));
  }
  throw torquer::Error(std::string(name) + " has the shape (" + shape + "); give (n, " +
                       std::to_string(columns) + ")");
}

py::array_t<double> ToRows(const std::vector<torquer::Point>& points) {
  py::array_t<double> out({static_cast<py::ssize_t>(points.size()), py::ssize_t{3}});
  if (!points.empty()) {
    std::memcpy(out.mutable_data(), points.data(), points.size() * sizeof(points[0]));
  }
  return out;
}

std::vector<Point> ToPoints(const Rows& rows, const char* name) {
  RequireColumns(rows, name, 3);
  std::vector<Point> points;
  for (py::ssize_t k = 0; k < rows.shape(0); ++k) {
    points.push_back({rows.at(k, 0), rows.at(k, 1), rows.at(k, 2)});
  }
  return points;
}

std::string PathText(const py::object& path) {
  const py::object text = py::module_::import("os").attr("fspath")(path);
  try {
    return text.cast<std::string>();
  } catch (const py::cast_error&) {
    throw Error(Printable(py::repr(text).cast<std::string>()) + ": is no path; check the path");
  }
}

py::tuple Reduce(const py::object& self, std::initializer_list<const char*> of) {
  py::dict values;
  for (const char* const property : of) values[property] = self.attr(property);
  const py::object partial = py::module_::import("functools").attr("partial");
  return py::make_tuple(partial(py::type::of(self), **values), py::tuple());
}

py::str Represent(const py::object& self, const char* name, std::initializer_list<const char*> of) {
  std::string text = std::string(name) + "(";
  for (const char* const property : of) {
    if (text.back() != '(') text += ", ";
    text += property + ("=" + py::repr(self.attr(property)).cast<std::string>());
  }
  return text + ")";
}

py::object ToReadings(const std::vector<Reading>& readings) {
  py::object out = py::module_::import("torquer._names").attr("Readings")();
  for (const Reading& reading : readings) out[py::str(reading.name)] = reading.value;
  return out;
}

void AddUnits(py::module_& module) {
  module.def(
      "unit_of",
      [](const std::string& name) {
        const std::string_view unit = UnitOfName(name);
        return py::str(unit.data(), unit.size());
      },
      py::arg("name"),
      "Unit of a reading, or of a field of a state, by its name: 'mN' for 'wall_force_sum_mN'; "
      "'1': "
      "no unit.");
  module.def("nearest_name", &NearestName, py::arg("given"), py::arg("known"),
             "Known name that `given` most likely meant; '' if none is near.");
  module.def("printable", &Printable, py::arg("text"), py::arg("most_bytes"),
             "Text for a message: without invisible characters, cut after most_bytes.");
}

}  // namespace torquer::python
