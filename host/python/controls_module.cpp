// Settings of the X-ray system and orders to the power injector for Python.
#include <algorithm>
#include <array>
#include <cstddef>
#include <iterator>
#include <string>

#include "host/python/module.h"
#include "host/support/nearest_name.h"
#include "host/support/printable_text.h"

namespace py = pybind11;
using torquer::Printable;
using torquer::python::Reduce;
using torquer::python::Represent;

namespace {

template <std::size_t kCount>
std::string DidYouMean(const std::string& given, const char* const (&known)[kCount]) {
  const std::string near = torquer::NearestName(given, {std::begin(known), std::end(known)});
  return near.empty() ? "" : "did you mean " + near + "? ";
}

// Python's names of the modes, in the order of the enumerators.
constexpr const char* kModes[] = {"as_scene", "plain", "subtraction", "roadmap", "cine"};

torquer::Imaging::Mode ModeOf(const std::string& name) {
  const auto* const found = std::find(std::begin(kModes), std::end(kModes), name);
  if (found != std::end(kModes)) {
    return static_cast<torquer::Imaging::Mode>(found - std::begin(kModes));
  }
  throw torquer::Error("mode is '" + Printable(name) + "'; " + DidYouMean(name, kModes) +
                       "give as_scene, plain, subtraction, roadmap or cine");
}

py::tuple PlaceOf(const torquer::Wedge& wedge) {
  return py::make_tuple(wedge.share, wedge.rotation_deg);
}

// Python's names of the orders to the power injector, in the order of the enumerators.
constexpr const char* kOrders[] = {"off", "arm", "inject"};

torquer::Injector::Order OrderOf(const std::string& name) {
  const auto* const found = std::find(std::begin(kOrders), std::end(kOrders), name);
  if (found != std::end(kOrders)) {
    return static_cast<torquer::Injector::Order>(found - std::begin(kOrders));
  }
  throw torquer::Error("order is '" + Printable(name) + "'; " + DidYouMean(name, kOrders) +
                       "give off, arm or inject");
}

void AddInjector(py::module_& module) {
  using torquer::Injector;
  const Injector as_scene;
  py::class_<Injector>(module, "Injector", "Order to the power injector, and its set-up.")
      .def(py::init([](const std::string& order, double volume_mL, double rate_mL_s, double delay_s,
                       double rise_s) {
             const Injector made{OrderOf(order), volume_mL, rate_mL_s, delay_s, rise_s};
             torquer::CheckInjector(made);
             return made;
           }),
           py::arg("order") = kOrders[0], py::kw_only(), py::arg("volume_mL") = as_scene.volume_mL,
           py::arg("rate_mL_s") = as_scene.rate_mL_s, py::arg("delay_s") = as_scene.delay_s,
           py::arg("rise_s") = as_scene.rise_s,
           "order: off; arm, for one injection; inject, which starts it. Another order stops it. "
           "Arm it again for the next one. volume_mL: 0.1 to 150. rate_mL_s: 0.1 to 45. delay_s: "
           "from the order to the first agent, 0 to 99.9. rise_s: time in which the rate rises "
           "from 0, 0 to 9.9. -1: value of the scene.")
      .def("__repr__",
           [](const py::object& self) {
             return Represent(self, "Injector",
                              {"order", "volume_mL", "rate_mL_s", "delay_s", "rise_s"});
           })
      .def("__reduce__",
           [](const py::object& self) {
             return Reduce(self, {"order", "volume_mL", "rate_mL_s", "delay_s", "rise_s"});
           })
      .def_property_readonly(
          "order", [](const Injector& self) { return kOrders[static_cast<int>(self.order)]; })
      .def_readonly("volume_mL", &Injector::volume_mL)
      .def_readonly("rate_mL_s", &Injector::rate_mL_s)
      .def_readonly("delay_s", &Injector::delay_s)
      .def_readonly("rise_s", &Injector::rise_s);
}

void AddImaging(py::module_& module) {
  using torquer::Imaging;
  py::class_<Imaging>(module, "Imaging", "Settings of the X-ray system.")
      .def(py::init([](const std::string& mode, double pulses_per_s, double magnification,
                       double left, double right, double top, double bottom,
                       const std::array<double, 2>& wedge_left,
                       const std::array<double, 2>& wedge_right) {
             const Imaging made{ModeOf(mode),
                                pulses_per_s,
                                magnification,
                                left,
                                right,
                                top,
                                bottom,
                                {wedge_left[0], wedge_left[1]},
                                {wedge_right[0], wedge_right[1]}};
             torquer::CheckImaging(made);
             return made;
           }),
           py::arg("mode") = kModes[0], py::kw_only(), py::arg("pulses_per_s") = 0.0,
           py::arg("magnification") = 1.0, py::arg("left") = 0.0, py::arg("right") = 0.0,
           py::arg("top") = 0.0, py::arg("bottom") = 0.0,
           py::arg("wedge_left") = std::array<double, 2>{},
           py::arg("wedge_right") = std::array<double, 2>{},
           "mode: as_scene, plain, subtraction, roadmap or cine. pulses_per_s: 1 to 60; 0: as in "
           "the scene. magnification: 1 to 4. left, right, top, bottom: fraction of the picture "
           "that each shutter covers, 0 to 0.45. wedge_left, wedge_right: wedge filters, each as "
           "the "
           "fraction of the picture that its edge has crossed, 0 to 0.5, and its clockwise turn in "
           "degrees, -90 to 90.")
      .def("__repr__",
           [](const py::object& self) {
             return Represent(self, "Imaging",
                              {"mode", "pulses_per_s", "magnification", "left", "right", "top",
                               "bottom", "wedge_left", "wedge_right"});
           })
      .def("__reduce__",
           [](const py::object& self) {
             return Reduce(self, {"mode", "pulses_per_s", "magnification", "left", "right", "top",
                                  "bottom", "wedge_left", "wedge_right"});
           })
      .def_property_readonly(
          "mode", [](const Imaging& self) { return kModes[static_cast<int>(self.mode)]; })
      .def_readonly("pulses_per_s", &Imaging::pulses_per_s)
      .def_readonly("magnification", &Imaging::magnification)
      .def_readonly("left", &Imaging::left)
      .def_readonly("right", &Imaging::right)
      .def_readonly("top", &Imaging::top)
      .def_readonly("bottom", &Imaging::bottom)
      .def_property_readonly("wedge_left",
                             [](const Imaging& self) { return PlaceOf(self.wedge_left); })
      .def_property_readonly("wedge_right",
                             [](const Imaging& self) { return PlaceOf(self.wedge_right); });
  py::tuple modes(std::size(kModes));
  for (std::size_t k = 0; k < std::size(kModes); ++k) modes[k] = kModes[k];
  module.attr("Imaging").attr("MODES") = modes;
}

}  // namespace

void torquer::python::AddControls(pybind11::module_& module) {
  AddImaging(module);
  AddInjector(module);
}
