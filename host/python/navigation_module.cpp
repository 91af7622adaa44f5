// The environments of torquer.envs for Python.
#include <cstddef>
#include <cstdint>
#include <memory>
#include <string>
#include <utility>

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

// The package checks the arguments of users. Their number is checked here, because a pool reads a
// fixed number of values.
void RequireValues(py::ssize_t given, std::size_t wanted, const char* what) {
  if (given == static_cast<py::ssize_t>(wanted)) return;
  throw Error(std::string(what) + " has " + std::to_string(given) + " values; give " +
              std::to_string(wanted));
}

}  // namespace

void AddNavigation(py::module_& module) {
  py::class_<NavigationTask>(module, "NavigationTask",
                             "Task of an environment, with the values of torquer.envs.Task.")
      .def(py::init([](std::size_t instrument, double within_mm, double step_s, double longest_mm,
                       double largest_turn_rad, double force_limit_mN, int max_steps, bool pictures,
                       const Rows& route) {
             NavigationTask task{.instrument = instrument,
                                 .within_mm = within_mm,
                                 .step_s = step_s,
                                 .longest_mm = longest_mm,
                                 .largest_turn_rad = largest_turn_rad,
                                 .force_limit_mN = force_limit_mN,
                                 .max_steps = max_steps,
                                 .pictures = pictures,
                                 .route = {}};
             RequireColumns(route, "route", 3);
             for (py::ssize_t k = 0; k < route.shape(0); ++k) {
               task.route.push_back({route.at(k, 0), route.at(k, 1), route.at(k, 2)});
             }
             return task;
           }),
           py::arg("instrument"), py::arg("within_mm"), py::arg("step_s"), py::arg("longest_mm"),
           py::arg("largest_turn_rad"), py::arg("force_limit_mN"), py::arg("max_steps"),
           py::arg("pictures"), py::arg("route"));
  py::class_<Navigation>(module, "Navigation",
                         "A navigation environment, with one episode after another.")
      .def(py::init<const Scene&, NavigationTask>(), py::arg("scene"), py::arg("task"), NoGil())
      .def(
          "reset",
          [](Navigation& self, double rotation_rad) {
            self.Reset(rotation_rad, EndsAtInterruption());
          },
          py::arg("rotation_rad"), NoGil())
      .def_static("check_rotation", &Navigation::CheckRotation, py::arg("rotation_rad"))
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
                       py::array& observations) {
             NavigationBuffers buffers;
             buffers.facts = facts.mutable_data();
             if (observations.dtype().kind() == 'f') {
               buffers.vectors = static_cast<float*>(observations.mutable_data());
             } else {
               buffers.pictures = static_cast<std::uint8_t*>(observations.mutable_data());
               buffers.picture_bytes = static_cast<std::size_t>(observations.nbytes()) / count;
             }
             const py::gil_scoped_release free;
             return PoolHolder(new NavigationPool(scene, task, count, threads, buffers));
           }),
           py::arg("scene"), py::arg("task"), py::arg("count"), py::arg("threads"),
           py::arg("facts"), py::arg("observations"), py::keep_alive<1, 6>(),
           py::keep_alive<1, 7>())
      .def("reset", &NavigationPool::Reset, py::arg("index"), py::arg("rotation_rad"))
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
      .def("check_rotation", &NavigationPool::CheckRotation, py::arg("rotation_rad"))
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
