// Scenes for Python.
#include <array>
#include <cstdint>
#include <exception>
#include <string>
#include <utility>
#include <vector>

#include "host/python/module.h"
#include "host/support/printable_text.h"

namespace py = pybind11;

namespace torquer::python {

Scene SceneFrom(const py::object& path) {
  const std::string text = PathText(path);
  const py::gil_scoped_release free;
  return Scene::FromFile(text);
}

namespace {

std::string Shown(py::handle value) { return Printable(py::repr(value).cast<std::string>()); }

[[noreturn]] void RefuseValue(const std::string& key, py::handle value) {
  throw Error("the value of " + Printable(key) + " is " + Shown(value) +
              "; give True, False, a number, a text, None, or a list of numbers, texts or points");
}

// A list of texts, numbers or points.
Value ToList(const std::string& key, py::handle value) {
  std::vector<std::string> texts;
  std::vector<double> numbers;
  std::vector<Point> points;
  const auto all = py::reinterpret_borrow<py::sequence>(value);
  for (const py::handle element : all) {
    if (py::isinstance<py::str>(element)) {
      texts.push_back(element.cast<std::string>());
    } else if (PyNumber_Check(element.ptr()) != 0 && PySequence_Check(element.ptr()) == 0) {
      numbers.push_back(element.cast<double>());
    } else {
      points.push_back(element.cast<Point>());
    }
  }
  const std::size_t count = all.size();
  if (count > 0 && texts.size() == count) return texts;
  if (count > 0 && points.size() == count) return points;
  if (numbers.size() == count) return numbers;
  RefuseValue(key, value);
}

Value ToValue(const std::string& key, py::handle value) {
  if (py::isinstance<py::array>(value) && py::reinterpret_borrow<py::array>(value).ndim() == 0) {
    return ToValue(key, value.attr("item")());
  }
  const bool is_numpy_bool = std::string(Py_TYPE(value.ptr())->tp_name).rfind("numpy.bool", 0) == 0;
  try {
    if (value.is_none()) return std::monostate();
    if (py::isinstance<py::bool_>(value) || is_numpy_bool) return value.cast<bool>();
    if (py::isinstance<py::str>(value)) return value.cast<std::string>();
    if (PySequence_Check(value.ptr()) != 0) return ToList(key, value);
    if (PyIndex_Check(value.ptr()) != 0) return value.cast<std::int64_t>();
    return value.cast<double>();
  } catch (const py::cast_error&) {
    RefuseValue(key, value);
  }
}

Scene UnpickleScene(const py::tuple& fields) {
  std::string text;
  std::string folder;
  std::string path;
  std::uint64_t hash = 0;
  try {
    text = fields[0].cast<std::string>();
    folder = fields[1].cast<std::string>();
    path = fields[2].cast<std::string>();
    hash = fields[3].cast<std::uint64_t>();
  } catch (const std::exception&) {
    throw Error("the pickled scene is damaged; pickle it again");
  }
  const py::gil_scoped_release free;
  Scene scene = Scene::FromText(text, folder, path);
  if (scene.content_hash() == hash) return scene;
  throw Error(folder + ": a file of the pickled scene " + scene.name() +
              " has changed since it was pickled; pickle the scene again");
}

Scene WithValues(const Scene& scene, const py::dict& values) {
  Values all;
  for (const auto& [key, value] : values) {
    if (!py::isinstance<py::str>(key)) {
      throw Error("a key of values is " + Shown(key) +
                  "; give a text, as 'effects.friction.coefficient'");
    }
    std::string name;
    try {
      name = key.cast<std::string>();
    } catch (const py::cast_error&) {
      throw Error("a key of values is " + Shown(key) +
                  ", which is not Unicode; give a key of a scene");
    }
    all.emplace_back(name, ToValue(name, value));
  }
  const py::gil_scoped_release free;
  return scene.With(all);
}

py::array_t<double> Clearances(const Scene& scene, const Rows& points_mm) {
  RequireColumns(points_mm, "points_mm", 3);
  py::array_t<double> out(points_mm.shape(0));
  auto values = out.mutable_unchecked<1>();
  const auto points = points_mm.unchecked<2>();
  Interruption interruption;
  const py::gil_scoped_release free;
  for (py::ssize_t k = 0; k < points.shape(0); ++k) {
    if (k % 1024 == 1023) interruption.Check();
    values(k) = scene.ClearanceMm({points(k, 0), points(k, 1), points(k, 2)});
  }
  return out;
}

}  // namespace

void AddScene(py::module_& module) {
  py::class_<InstrumentInfo>(module, "InstrumentInfo", "An instrument of a scene.")
      .def("__repr__",
           [](const py::object& self) {
             return Represent(self, "InstrumentInfo", {"name", "max_length_mm", "tip_radius_mm"});
           })
      .def_readonly("name", &InstrumentInfo::name)
      .def_readonly("max_length_mm", &InstrumentInfo::max_length_mm)
      .def_readonly("tip_radius_mm", &InstrumentInfo::tip_radius_mm)
      .def_readonly("inner_radius_mm", &InstrumentInfo::inner_radius_mm,
                    "Radius of the lumen in mm; 0: solid.")
      .def_property_readonly(
          "start",
          [](const InstrumentInfo& self) {
            return py::make_tuple(self.start.insertion_mm, self.start.rotation_rad);
          },
          "Insertion in mm and rotation in rad at the start.")
      .def_readonly("is_beside", &InstrumentInfo::is_beside,
                    "True if it lies beside the earlier instruments, with [instrument.entry].");
  py::class_<ScriptRow>(module, "ScriptRow", "A row of a script, for Simulation.step_row.")
      .def("__repr__",
           [](const py::object& self) {
             return Represent(self, "ScriptRow", {"place", "time_s", "exchanges"});
           })
      .def_readonly("place", &ScriptRow::place, "File and line.")
      .def_readonly("time_s", &ScriptRow::time_s, "Time in the file.")
      .def_readonly("exchanges", &ScriptRow::exchanges,
                    "Exchanges before the motion: the number of an instrument, and its device.");
  py::class_<Scene>(module, "Scene", "A scene, read from a file and checked, with its vessel.")
      .def(py::init(&SceneFrom), py::arg("path"),
           "Reads a scene file, or a scene of Torquer by its name, and the files that it names.")
      .def("__repr__",
           [](const py::object& self) {
             return Represent(self, "Scene", {"name", "path"});
           })
      .def_static("from_text", &Scene::FromText, py::arg("text"), py::arg("folder") = ".",
                  py::arg("path") = "scene", NoGil(),
                  "Reads a scene from the text of a scene file; its paths are relative to folder. "
                  "Messages name path as its file.")
      .def("with_values", &WithValues, py::arg("values"),
           "The scene with other values of some keys, such as "
           "{'effects.friction.coefficient': 0.2, 'instrument.guidewire.radius_mm': 0.4}. Values "
           "are true or false, numbers, texts, or lists. None removes a key, so that its default "
           "is valid. For 'effects.NAME', True adds the effect and False removes it. The vessel is "
           "not read again unless a key of it changes.")
      .def("parse_script", &Scene::ParseScript, py::arg("text"), py::arg("path") = "script",
           NoGil(),
           "Rows of a script's text, a table as for torquer-simulator --script. Messages name path "
           "as its file.")
      .def_property_readonly("name", &Scene::name)
      .def_property_readonly("path", &Scene::path,
                             "Path of the scene file, or that given to from_text.")
      .def_property_readonly("text", &Scene::text, "All keys with their values, as a scene file.")
      .def_property_readonly("folder", &Scene::folder)
      .def_property_readonly("content_hash", &Scene::content_hash,
                             "Hash of the scene's text and of the files that it names.")
      .def_property_readonly("instruments", &Scene::instruments,
                             "Instruments of the scene, the innermost first.")
      .def_property_readonly("effects", &Scene::effects)
      .def_property_readonly("findings", &Scene::findings,
                             "Defects that were found in the vessel's file and repaired.")
      .def_property_readonly("centerlines", &Scene::centerlines, "Names of the centerlines.")
      .def_property_readonly(
          "bounds_mm",
          [](const Scene& scene) {
            const std::array<Point, 2> box = scene.bounds_mm();
            return ToRows({box[0], box[1]});
          },
          "Two corners of the vessel's bounding box, shape (2, 3).")
      .def("keep_field", &Scene::KeepField, NoGil(),
           "Stores the built parts of the vessel's field for later programs now, instead of when "
           "the scene is deleted. Returns the reason if that fails, otherwise an empty text.")
      .def("surface", &Scene::surface,
           "Surface of the lumen at rest. An error for a vessel that does not come from a surface.")
      .def("clearance_mm", &Clearances, py::arg("points_mm"),
           "Distances of points, shape (n, 3), from the wall, positive in the lumen; shape (n,).")
      .def(
          "centerline_mm",
          [](const Scene& scene, const std::string& name, double step_mm) {
            return ToRows(scene.CenterlineMm(name, step_mm));
          },
          py::arg("name"), py::arg("step_mm") = 1.0,
          "Points along a centerline, step_mm apart, shape (n, 3).")
      .def(
          "route_mm",
          [](const Scene& scene, const std::string& centerline, double at_mm, double step_mm,
             std::size_t instrument) {
            return ToRows(scene.RouteMm(centerline, at_mm, step_mm, instrument));
          },
          py::arg("centerline"), py::arg("at_mm"), py::arg("step_mm") = 1.0,
          py::arg("instrument") = 0,
          "Points along the shortest route from the entry of an instrument to a place on a "
          "centerline, step_mm apart, shape (n, 3).")
      .def("__copy__", [](const Scene& self) { return self; })
      .def(
          "__deepcopy__", [](const Scene& self, const py::object& /*memo*/) { return self; },
          py::arg("memo"))
      .def(py::pickle(
          [](const Scene& scene) {
            return py::make_tuple(scene.text(), scene.folder(), scene.path(), scene.content_hash());
          },
          &UnpickleScene));
}

}  // namespace torquer::python
