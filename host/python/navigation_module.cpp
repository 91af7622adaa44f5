// The environments of torquer.envs for Python.
#include <array>
#include <cstddef>
#include <cstdint>
#include <exception>
#include <memory>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "host/python/module.h"

namespace py = pybind11;

namespace torquer::python {

namespace {

using Actions = py::array_t<double, py::array::c_style | py::array::forcecast>;
using Indices = py::array_t<std::int64_t, py::array::c_style | py::array::forcecast>;

py::array_t<float> VectorOf(const Navigation& navigation) {
  py::array_t<float> out(static_cast<py::ssize_t>(navigation.vector_size()));
  navigation.Observe(out.mutable_data());
  return out;
}

NavigationStart ToStart(double rotation_rad, const std::optional<Rows>& route) {
  return {.rotation_rad = rotation_rad,
          .route = route ? ToPoints(*route, "route") : std::vector<Point>()};
}

py::tuple ToTuple(const NavigationState& state) {
  const NavigationMemory& memory = state.memory;
  return py::make_tuple(py::bytes(state.simulation), ToRows(memory.route), memory.tip,
                        memory.nearest, memory.begun, memory.steps, memory.worst_mN,
                        memory.any_unknown, memory.facts);
}

// A cast would take None for False.
bool ToBool(const py::handle value) {
  if (!py::isinstance<py::bool_>(value)) throw py::cast_error("not a bool");
  return value.cast<bool>();
}

NavigationState ToState(const py::tuple& saved) {
  try {
    return {.simulation = saved[0].cast<std::string>(),
            .memory = {.route = ToPoints(saved[1].cast<Rows>(), "route"),
                       .tip = saved[2].cast<Point>(),
                       .nearest = saved[3].cast<std::size_t>(),
                       .begun = ToBool(saved[4]),
                       .steps = saved[5].cast<int>(),
                       .worst_mN = saved[6].cast<double>(),
                       .any_unknown = ToBool(saved[7]),
                       .facts = saved[8].cast<std::array<double, kFacts>>()}};
  } catch (const std::exception&) {
    throw Error("the saved environment is damaged; save it again");
  }
}

void LoadInto(Navigation& navigation, const py::tuple& saved) {
  const NavigationState state = ToState(saved);
  const py::gil_scoped_release free;
  navigation.Load(state, [interruption = Interruption()]() mutable { interruption.Check(); });
}

py::tuple PickleTask(const NavigationTask& task) {
  return py::make_tuple(task.instrument, task.within_mm, task.step_s, task.longest_mm,
                        task.largest_turn_rad, task.force_limit_mN, task.max_steps, task.pictures,
                        ToRows(task.route));
}

std::shared_ptr<Navigation> UnpickleNavigation(const py::tuple& fields) {
  std::shared_ptr<Navigation> made;
  py::tuple saved;
  try {
    const auto task = py::type::of<NavigationTask>()(*fields[1].cast<py::tuple>());
    made = std::make_shared<Navigation>(fields[0].cast<Scene>(), task.cast<NavigationTask>());
    saved = fields[2].cast<py::tuple>();
  } catch (const std::exception&) {
    throw Error("the pickled environment is damaged; pickle it again");
  }
  LoadInto(*made, saved);
  return made;
}

// The package checks the arguments of users. Their number is checked here, because a pool reads a
// fixed number of values.
void RequireValues(py::ssize_t given, std::size_t wanted, const char* what) {
  if (given == static_cast<py::ssize_t>(wanted)) return;
  throw Error(std::string(what) + " has " + std::to_string(given) + " values; give " +
              std::to_string(wanted));
}

}  // namespace

void AddNavigation(py::module_& module) {
  py::tuple names(kFacts);
  for (std::size_t k = 0; k < kFacts; ++k) names[k] = kFactNames[k];
  module.attr("FACTS") = names;
  py::class_<NavigationTask>(module, "NavigationTask",
                             "Task of an environment, with the values of torquer.envs.Task.")
      .def(py::init([](std::size_t instrument, double within_mm, double step_s, double longest_mm,
                       double largest_turn_rad, double force_limit_mN, int max_steps, bool pictures,
                       const Rows& route) {
             return NavigationTask{.instrument = instrument,
                                   .within_mm = within_mm,
                                   .step_s = step_s,
                                   .longest_mm = longest_mm,
                                   .largest_turn_rad = largest_turn_rad,
                                   .force_limit_mN = force_limit_mN,
                                   .max_steps = max_steps,
                                   .pictures = pictures,
                                   .route = ToPoints(route, "route")};
           }),
           py::arg("instrument"), py::arg("within_mm"), py::arg("step_s"), py::arg("longest_mm"),
           py::arg("largest_turn_rad"), py::arg("force_limit_mN"), py::arg("max_steps"),
           py::arg("pictures"), py::arg("route"));
  py::class_<Navigation, std::shared_ptr<Navigation>>(
      module, "Navigation", "A navigation environment, with one episode after another.")
      .def(py::init<const Scene&, NavigationTask>(), py::arg("scene"), py::arg("task"), NoGil())
      .def(
          "reset",
          [](Navigation& self, double rotation_rad, const std::optional<Rows>& route) {
            const NavigationStart start = ToStart(rotation_rad, route);
            const py::gil_scoped_release free;
            self.Reset(start, EndsAtInterruption());
          },
          py::arg("rotation_rad"), py::arg("route") = py::none())
      .def_static(
          "check_rotation",
          [](double rotation_rad) { Navigation::CheckStart({.rotation_rad = rotation_rad}); },
          py::arg("rotation_rad"))
      .def(py::pickle(
          [](Navigation& self) {
            return py::make_tuple(self.simulation().scene(), PickleTask(self.task()),
                                  ToTuple(self.Save()));
          },
          &UnpickleNavigation))
      .def(
          "__deepcopy__",
          [](const Navigation& self, const py::object& /*memo*/) {
            return std::make_shared<Navigation>(self);
          },
          py::arg("memo"))
      .def(
          "step",
          [](Navigation& self, const Actions& action) {
            RequireValues(action.size(), self.action_size(), "action");
            const double* const values = action.data();
            const py::gil_scoped_release free;
            self.Step(values, EndsAtInterruption());
          },
          py::arg("action"))
      .def_property_readonly(
          "facts", [](const Navigation& self) { return self.facts(); },
          "Reward, terminated, truncated, success, safe success, force, path length, remaining "
          "distance, time.")
      .def("observe", &VectorOf)
      .def("take_picture",
           [](Navigation& self) {
             const Picture& picture = self.TakePicture();
             return py::array_t<std::uint8_t>({picture.height, picture.width}, picture.gray.data());
           })
      .def_property_readonly("simulation", &Navigation::simulation,
                             py::return_value_policy::reference_internal);
  using PoolHolder = std::unique_ptr<NavigationPool, NavigationPoolEnd>;
  py::class_<NavigationPool, PoolHolder>(module, "NavigationPool",
                                         "Environments that run in threads.")
      .def(py::init([](const Scene& scene, const NavigationTask& task, std::size_t count,
                       std::size_t threads, py::array_t<double, py::array::c_style>& facts,
                       std::optional<py::array_t<float, py::array::c_style>>& vectors,
                       std::optional<py::array_t<std::uint8_t, py::array::c_style>>& pictures) {
             NavigationBuffers buffers;
             buffers.facts = facts.mutable_data();
             if (vectors) buffers.vectors = vectors->mutable_data();
             if (pictures) {
               buffers.pictures = pictures->mutable_data();
               buffers.picture_bytes = static_cast<std::size_t>(pictures->nbytes()) / count;
             }
             const py::gil_scoped_release free;
             return PoolHolder(new NavigationPool(scene, task, count, threads, buffers));
           }),
           py::arg("scene"), py::arg("task"), py::arg("count"), py::arg("threads"),
           py::arg("facts"), py::arg("vectors"), py::arg("pictures"), py::keep_alive<1, 6>(),
           py::keep_alive<1, 7>(), py::keep_alive<1, 8>())
      .def(
          "reset",
          [](NavigationPool& self, std::size_t index, double rotation_rad,
             const std::optional<Rows>& route) { self.Reset(index, ToStart(rotation_rad, route)); },
          py::arg("index"), py::arg("rotation_rad"), py::arg("route") = py::none())
      .def(
          "save",
          [](NavigationPool& self, std::size_t index) {
            return ToTuple(self.environment(index)->Save());
          },
          py::arg("index"))
      .def(
          "load",
          [](NavigationPool& self, std::size_t index, const py::tuple& saved) {
            LoadInto(*self.environment(index), saved);
          },
          py::arg("index"), py::arg("saved"))
      .def(
          "environment",
          [](NavigationPool& self, std::size_t index) { return self.environment(index); },
          py::arg("index"))
      .def("exchange", &NavigationPool::Exchange, py::arg("index"), py::arg("next"))
      .def("require_own_process", &NavigationPool::RequireOwnProcess)
      .def(
          "step",
          [](NavigationPool& self, const Indices& indices, const Actions& actions) {
            RequireValues(actions.size(),
                          static_cast<std::size_t>(indices.size()) * self.action_size(), "actions");
            const auto size = static_cast<std::ptrdiff_t>(self.action_size());
            for (py::ssize_t k = 0; k < indices.size(); ++k) {
              self.CheckAction(actions.data() + k * size);
            }
            for (py::ssize_t k = 0; k < indices.size(); ++k) {
              const double* const action = actions.data() + k * size;
              self.Step(static_cast<std::size_t>(indices.data()[k]), {action, action + size});
            }
          },
          py::arg("indices"), py::arg("actions"))
      .def_static(
          "check_rotation",
          [](double rotation_rad) { NavigationPool::CheckStart({.rotation_rad = rotation_rad}); },
          py::arg("rotation_rad"))
      .def(
          "wait",
          [](NavigationPool& self, std::size_t count) {
            Interruption interruption;
            for (;;) {
              auto indices = self.WaitFor(count, std::chrono::milliseconds(100));
              if (indices) return *std::move(indices);
              interruption.Check();
            }
          },
          py::arg("count"), NoGil())
      .def_property_readonly("at_work", &NavigationPool::at_work);
}

}  // namespace torquer::python
