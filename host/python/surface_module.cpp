// torquer.Surface: repaired surfaces of lumens as arrays.
#include <array>
#include <cstdint>
#include <cstring>
#include <string>
#include <vector>

#include "host/python/module.h"

namespace py = pybind11;

namespace torquer::python {

namespace {

using Triangles = py::array_t<std::int32_t, py::array::c_style | py::array::forcecast>;

Surface SurfaceFrom(const Rows& points, const Triangles& triangles, const std::string& name,
                    const std::string& mesh_unit) {
  RequireColumns(points, "points", 3);
  if (triangles.ndim() != 2 || triangles.shape(1) != 3) {
    throw Error("triangles do not have the shape (n, 3)");
  }
  std::vector<Point> places(points.shape(0));
  std::vector<std::array<std::int32_t, 3>> corners(triangles.shape(0));
  if (!places.empty()) {
    std::memcpy(places.data(), points.data(), places.size() * sizeof(places[0]));
  }
  if (!corners.empty()) {
    std::memcpy(corners.data(), triangles.data(), corners.size() * sizeof(corners[0]));
  }
  const py::gil_scoped_release free;
  return Surface::FromTriangles(places, corners, name, mesh_unit);
}

}  // namespace

void AddSurface(py::module_& module) {
  py::class_<SurfaceCheck>(module, "SurfaceCheck", "Result of check_mesh.")
      .def("__repr__",
           [](const py::object& self) { return Represent(self, "SurfaceCheck", {"is_usable"}); })
      .def("__str__", [](const SurfaceCheck& self) { return self.text; })
      .def_readonly("is_usable", &SurfaceCheck::is_usable, "True if a scene can have the surface.")
      .def_readonly("text", &SurfaceCheck::text, "Findings for a person, line by line.")
      .def_readonly("proposal", &SurfaceCheck::proposal,
                    "Tables [vessel] and [entry] of a scene; empty if it is not usable.");
  module.def(
      "check_mesh",
      [](const py::object& path) {
        const std::string text = PathText(path);
        const py::gil_scoped_release free;
        return CheckSurface(text);
      },
      py::arg("path"), "Checks a surface file, as torquer-simulator --check-mesh does.");
  py::class_<Surface>(module, "Surface", "Repaired, closed surface of a lumen.")
      .def(py::init([](const py::object& path, const std::string& mesh_unit) {
             const std::string text = PathText(path);
             const py::gil_scoped_release free;
             return Surface::FromFile(text, mesh_unit);
           }),
           py::arg("path"), py::arg("mesh_unit"),
           "Reads and repairs an STL, OBJ or PLY file; mesh_unit as in a scene.")
      .def("__repr__", [](const py::object& self) { return Represent(self, "Surface", {"space"}); })
      .def_static("from_triangles", &SurfaceFrom, py::arg("points"), py::arg("triangles"),
                  py::arg("name"), py::arg("mesh_unit"),
                  "Repairs triangles, shape (n, 3); name stands for the file in messages.")
      .def_property_readonly(
          "points_mm", [](const Surface& surface) { return ToRows(surface.points_mm); },
          "Shape (n, 3).")
      .def_property_readonly(
          "triangles",
          [](const Surface& surface) {
            Triangles out({static_cast<py::ssize_t>(surface.triangles.size()), py::ssize_t{3}});
            const std::size_t bytes = surface.triangles.size() * sizeof(surface.triangles[0]);
            if (bytes > 0) std::memcpy(out.mutable_data(), surface.triangles.data(), bytes);
            return out;
          },
          "Numbers of points, counterclockwise as seen from outside, shape (m, 3).")
      .def_readonly("findings", &Surface::findings, "Defects that were found and repaired.")
      .def_readonly("space", &Surface::space,
                    "'LPS' or 'RAS' if the file names its coordinate system, otherwise empty.");
}

}  // namespace torquer::python
