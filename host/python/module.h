// Types and helpers that the sources of torquer._torquer share.
#pragma once

#include <pybind11/numpy.h>
#include <pybind11/pybind11.h>
#include <pybind11/stl.h>
#include <torquer/torquer.h>

#include <chrono>
#include <functional>
#include <initializer_list>
#include <string>
#include <vector>

#include "host/python/navigation.h"
#include "host/python/navigation_pool.h"

namespace torquer::python {

// Refuses an object that __new__ made without __init__, because its memory has no value.
template <class Type>
class MadeCaster : public pybind11::detail::type_caster_base<Type> {
 public:
  bool load(pybind11::handle source, bool convert) {
    const pybind11::detail::type_info* const type =
        pybind11::detail::get_type_info(typeid(Type), true);
    if (PyObject_TypeCheck(source.ptr(), type->type) != 0) {
      auto* const made = reinterpret_cast<pybind11::detail::instance*>(source.ptr());
      if (made->get_value_and_holder(type).value_ptr() == nullptr) {
        throw Error(std::string("this ") + type->type->tp_name + " was not made; call its class");
      }
    }
    return pybind11::detail::type_caster_base<Type>::load(source, convert);
  }
};

}  // namespace torquer::python

namespace pybind11::detail {
#define TORQUER_MADE(Type) \
  template <>              \
  class type_caster<Type> : public torquer::python::MadeCaster<Type> {}
TORQUER_MADE(torquer::InstrumentInfo);
TORQUER_MADE(torquer::Scene);
TORQUER_MADE(torquer::Surface);
TORQUER_MADE(torquer::SurfaceCheck);
TORQUER_MADE(torquer::ScriptRow);
TORQUER_MADE(torquer::StepReport);
TORQUER_MADE(torquer::Sensitivity);
TORQUER_MADE(torquer::Imaging);
TORQUER_MADE(torquer::Injector);
TORQUER_MADE(torquer::Simulation);
TORQUER_MADE(torquer::python::NavigationTask);
TORQUER_MADE(torquer::python::Navigation);
TORQUER_MADE(torquer::python::NavigationPool);
#undef TORQUER_MADE
}  // namespace pybind11::detail

namespace torquer::python {

using Rows = pybind11::array_t<double, pybind11::array::c_style | pybind11::array::forcecast>;
using NoGil = pybind11::call_guard<pybind11::gil_scoped_release>;

/// Ends long work without Python's lock after Ctrl-C: checks for it every 100 ms.
class Interruption {
 public:
  void Check() {
    const auto now = std::chrono::steady_clock::now();
    if (now - last_ < std::chrono::milliseconds(100)) return;
    last_ = now;
    const pybind11::gil_scoped_acquire locked;
    if (PyErr_CheckSignals() != 0) throw pybind11::error_already_set();
  }

 private:
  std::chrono::steady_clock::time_point last_ = std::chrono::steady_clock::now();
};

/// Makes the `after_tick` of a step from an Interruption.
inline std::function<bool(const StepReport&)> EndsAtInterruption() {
  return [interruption = Interruption()](const StepReport&) mutable {
    interruption.Check();
    return true;
  };
}

/// Throws if the array does not consist of rows with this number of columns.
void RequireColumns(const Rows& rows, const char* name, int columns);

/// Points as an array of the shape (n, 3).
pybind11::array_t<double> ToRows(const std::vector<Point>& points);

/// Points of an array; throws as RequireColumns.
std::vector<Point> ToPoints(const Rows& rows, const char* name);

/// A path from Python: text, or an object like pathlib.Path. Others are a TypeError.
std::string PathText(const pybind11::object& path);

/// Reads a scene by its path or name, without Python's lock.
Scene SceneFrom(const pybind11::object& path);

/// Arguments that make an object again from its properties, for pickles and copies.
pybind11::tuple Reduce(const pybind11::object& self, std::initializer_list<const char*> of);

/// Representation of an object with some of its properties, such as "Imaging(mode='plain')".
pybind11::str Represent(const pybind11::object& self, const char* name,
                        std::initializer_list<const char*> of);

void AddScene(pybind11::module_& module);
void AddUnits(pybind11::module_& module);
void AddSurface(pybind11::module_& module);
void AddControls(pybind11::module_& module);
void AddNavigation(pybind11::module_& module);
void AddSensitivity(pybind11::module_& module);
/// Readings by name, with an error for other names.
pybind11::object ToReadings(const std::vector<Reading>& readings);
/// Derivatives by key.
pybind11::dict SensitivitiesOf(const Simulation& simulation);

}  // namespace torquer::python
