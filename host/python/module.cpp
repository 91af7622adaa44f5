// torquer._torquer: torquer.h for Python. Users import the package around it.
#include "host/python/module.h"

#include <array>
#include <cstring>
#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <utility>
#include <vector>

namespace py = pybind11;
using torquer::Scene;
using torquer::Simulation;
using torquer::python::EndsAtInterruption;
using torquer::python::Interruption;
using torquer::python::NoGil;
using torquer::python::Represent;
using torquer::python::RequireColumns;
using torquer::python::Rows;
using torquer::python::SceneFrom;
using torquer::python::ToPoints;
using torquer::python::ToRows;

namespace {

py::array_t<double> ToColumn(const std::vector<double>& values) {
  return py::array_t<double>(static_cast<py::ssize_t>(values.size()), values.data());
}

std::vector<torquer::Hand> ToHands(const Rows& rows) {
  RequireColumns(rows, "hands", 2);
  std::vector<torquer::Hand> hands;
  for (py::ssize_t k = 0; k < rows.shape(0); ++k) hands.push_back({rows.at(k, 0), rows.at(k, 1)});
  return hands;
}

template <class Get>
py::array_t<double> HandsOf(std::size_t count, Get get) {
  py::array_t<double> out({static_cast<py::ssize_t>(count), py::ssize_t{2}});
  auto rows = out.mutable_unchecked<2>();
  for (std::size_t k = 0; k < count; ++k) {
    const torquer::Hand hand = get(k);
    rows(static_cast<py::ssize_t>(k), 0) = hand.insertion_mm;
    rows(static_cast<py::ssize_t>(k), 1) = hand.rotation_rad;
  }
  return out;
}

// Copy of the present nodes, in memory that is read-only for Python.
py::array_t<double> Nodes(const Simulation& simulation) {
  auto kept = std::make_unique<std::vector<double>>();
  simulation.WhileStill([&] {
    const double* const nodes_mm = simulation.nodes_mm();
    kept->assign(nodes_mm, nodes_mm + 3 * simulation.node_count());
  });
  std::vector<double>& values = *kept;
  const py::capsule memory(kept.release(),
                           [](void* it) { delete static_cast<std::vector<double>*>(it); });
  py::array_t<double> out({static_cast<py::ssize_t>(values.size() / 3), py::ssize_t{3}},
                          values.data(), memory);
  py::detail::array_proxy(out.ptr())->flags &= ~py::detail::npy_api::NPY_ARRAY_WRITEABLE_;
  return out;
}

py::dict ToDict(const std::vector<torquer::Contact>& contacts) {
  py::dict out;
  for (const torquer::Contact& contact : contacts) {
    out[py::int_(contact.node)] = contact.penetration_mm;
  }
  return out;
}

py::dict ForcesOf(const Simulation& simulation) {
  const torquer::Forces forces = simulation.forces();
  py::dict out;
  out["contact_mN"] = ToRows(forces.contact_mN);
  out["line_load_mN_mm"] = ToColumn(forces.line_load_mN_mm);
  out["tension_mN"] = ToColumn(forces.tension_mN);
  out["bending_mN_mm"] = ToColumn(forces.bending_mN_mm);
  out["twisting_mN_mm"] = ToColumn(forces.twisting_mN_mm);
  return out;
}

py::object PictureOf(Simulation& simulation, int plane) {
  const torquer::Picture* picture = nullptr;
  {
    const py::gil_scoped_release free;
    picture = &simulation.LastPicture(plane);
  }
  py::object out = py::none();
  simulation.WhileStill([&] {
    if (picture->width == 0) return;
    out = py::array_t<std::uint8_t>({picture->height, picture->width}, picture->gray.data());
  });
  return out;
}

py::array_t<double> PlacesOf(const Simulation& simulation, const Rows& points_mm, int plane) {
  const std::vector<torquer::PicturePlace> places =
      simulation.PlacesInPicture(ToPoints(points_mm, "points_mm"), plane);
  py::array_t<double> out({static_cast<py::ssize_t>(places.size()), py::ssize_t{2}});
  auto rows = out.mutable_unchecked<2>();
  for (std::size_t k = 0; k < places.size(); ++k) {
    rows(static_cast<py::ssize_t>(k), 0) = places[k].column;
    rows(static_cast<py::ssize_t>(k), 1) = places[k].row;
  }
  return out;
}

// Only False ends a step; a call without a result continues it.
std::function<bool(const torquer::StepReport&)> ToAfterTick(const py::object& call) {
  if (call.is_none()) return EndsAtInterruption();
  return [&call, interruption = Interruption()](const torquer::StepReport& tick) mutable {
    interruption.Check();
    const py::gil_scoped_acquire locked;
    return call(tick).ptr() != Py_False;
  };
}

// A scene of a simulation, which another thread may exchange meanwhile.
Scene SceneOf(const Simulation& simulation, bool at_start) {
  std::optional<Scene> scene;
  simulation.WhileStill(
      [&] { scene = at_start ? simulation.scene_at_start() : simulation.scene(); });
  return *scene;
}

Simulation UnpickleSimulation(const py::tuple& fields) {
  if (fields.size() != 2 || !py::isinstance<Scene>(fields[0]) ||
      !py::isinstance<py::bytes>(fields[1])) {
    throw torquer::Error("the pickled simulation is damaged; pickle it again");
  }
  const auto scene = fields[0].cast<Scene>();
  const auto saved = fields[1].cast<std::string>();
  const py::gil_scoped_release free;
  return Simulation::Load(scene, saved,
                          [interruption = Interruption()]() mutable { interruption.Check(); });
}

void AddSimulation(py::module_& module) {
  using torquer::Imaging;
  using torquer::StepReport;
  py::class_<StepReport>(module, "StepReport", "Report of a step.")
      .def("__repr__",
           [](const py::object& self) {
             return Represent(self, "StepReport",
                              {"ticks", "iterations", "work", "converged", "budget_spent",
                               "stalled", "snapped", "finished"});
           })
      .def_readonly("ticks", &StepReport::ticks, "Number of ticks that the step was divided into.")
      .def_readonly("iterations", &StepReport::iterations)
      .def_readonly("work", &StepReport::work, "Work done, in units of the budget.")
      .def_readonly("converged", &StepReport::converged,
                    "True if every tick relaxed to the scene's tolerance.")
      .def_readonly("budget_spent", &StepReport::budget_spent)
      .def_readonly("stalled", &StepReport::stalled)
      .def_readonly("snapped", &StepReport::snapped,
                    "True if the tip snapped: it moved much farther than the hands.")
      .def_readonly("finished", &StepReport::finished, "False if after_tick ended the step early.");
  py::class_<Simulation>(module, "Simulation", "A running simulation of a scene.")
      .def(py::init<const Scene&>(), py::arg("scene"), NoGil(),
           "Makes a simulation at the start of the scene.")
      .def(py::init([](const py::object& path) { return Simulation(SceneFrom(path)); }),
           py::arg("scene"),
           "Makes a simulation of a scene file, or of a scene that Torquer ships, by its name.")
      .def("__repr__",
           [](const py::object& self) {
             return Represent(self, "Simulation", {"scene", "time_s"});
           })
      .def_property_readonly(
          "scene", [](const Simulation& self) { return SceneOf(self, false); },
          "The scene, with the devices of exchange().")
      .def_property_readonly(
          "scene_at_start", [](const Simulation& self) { return SceneOf(self, true); },
          "The scene with which the simulation began, to which restart() returns.")
      .def("restart", &Simulation::Restart, NoGil(), "Returns to the start of scene_at_start.")
      .def("exchange", &Simulation::Exchange, py::arg("instrument"), py::arg("device"), NoGil(),
           "Exchanges an instrument for a device of host/devices, between two steps. The "
           "instrument must be withdrawn to 0 mm. It keeps its name, length and hand, and has no "
           "other key of the scene. All else goes on as it is. Copies and pickles have the "
           "exchange too.")
      .def(
          "copy", [](const Simulation& self) { return std::make_unique<Simulation>(self); },
          NoGil(), "Returns an independent copy, which continues from the same state.")
      .def(py::pickle(
          [](const Simulation& self) {
            std::string saved;
            Scene scene = SceneOf(self, true);
            {
              const py::gil_scoped_release free;
              saved = self.Save();
            }
            return py::make_tuple(std::move(scene), py::bytes(saved));
          },
          &UnpickleSimulation))
      .def("__copy__", [](const Simulation& self) { return std::make_unique<Simulation>(self); })
      .def(
          "__deepcopy__",
          [](const Simulation& self, const py::object& /*memo*/) {
            return std::make_unique<Simulation>(self);
          },
          py::arg("memo"))
      .def(
          "restore",
          [](Simulation& self, const Simulation& saved) {
            const Scene here = SceneOf(self, true);
            if (here.content_hash() != SceneOf(saved, true).content_hash()) {
              throw torquer::Error("restore of " + here.name() + " is given a simulation of " +
                                   SceneOf(saved, true).name() + "; give one of the same scene");
            }
            self = saved;
          },
          py::arg("saved"), NoGil(),
          "Takes over the state of another simulation of the same scene.")
      .def(
          "step",
          [](Simulation& self, double time_s, const Rows& hands, double lao_deg, double cra_deg,
             bool xray, bool contrast, const Imaging& imaging,
             const std::array<double, 3>& table_mm, const torquer::Injector& injector,
             const py::object& after_tick) {
            const torquer::Command command{.time_s = time_s,
                                           .hands = ToHands(hands),
                                           .lao_deg = lao_deg,
                                           .cra_deg = cra_deg,
                                           .xray = xray,
                                           .contrast = contrast,
                                           .imaging = imaging,
                                           .table = {table_mm[0], table_mm[1], table_mm[2]},
                                           .injector = injector};
            const auto call = ToAfterTick(after_tick);
            const py::gil_scoped_release free;
            return self.Step(command, call);
          },
          py::arg("time_s"), py::arg("hands"), py::kw_only(), py::arg("lao_deg") = 0.0,
          py::arg("cra_deg") = 0.0, py::arg("xray") = false, py::arg("contrast") = false,
          py::arg("imaging") = Imaging(), py::arg("table_mm") = std::array<double, 3>{},
          py::arg("injector") = torquer::Injector(), py::arg("after_tick") = py::none(),
          "Advances the simulation to time_s, which must be later than the previous step. hands: "
          "positions at the end, shape (instruments, 2), insertion past the entry in mm and "
          "rotation in rad. The hands move at constant speed. table_mm: displacement of the table "
          "to the patient's left, to the head, and up. after_tick is called with the report "
          "of each tick. If it returns False or raises, the step ends there, and the next step "
          "continues from there.")
      .def(
          "step_row",
          [](Simulation& self, const torquer::ScriptRow& row, const py::object& after_tick) {
            const auto call = ToAfterTick(after_tick);
            const py::gil_scoped_release free;
            return self.StepRow(row, call);
          },
          py::arg("row"), py::kw_only(), py::arg("after_tick") = py::none(),
          "Carries out the exchanges and the motion of a row of Scene.parse_script, as "
          "torquer-simulator --script does. after_tick: as for step.")
      .def_property_readonly("time_s", &Simulation::time_s)
      .def_property_readonly("nodes_mm", &Nodes,
                             "Nodes of the wire, from the entry to the tip, shape (n, 3). With "
                             "[effects.clearance] or [instrument.entry] instruments lie on several "
                             "curves. These are then the nodes of the one that reaches farthest, "
                             "and another step may make it another one.")
      .def(
          "instrument_nodes_mm",
          [](const Simulation& self, std::size_t instrument) {
            return ToRows(self.InstrumentNodesMm(instrument));
          },
          py::arg("instrument"),
          "Nodes of an instrument, from its entry to its tip, on whichever curve it lies, shape "
          "(n, 3). The innermost instrument is number 0.")
      .def_property_readonly(
          "hands",
          [](const Simulation& self) {
            std::vector<torquer::Hand> hands;
            self.WhileStill([&] { hands = self.command().hands; });
            return HandsOf(hands.size(), [&](std::size_t k) { return hands[k]; });
          },
          "Commanded hand positions of the last step, shape (instruments, 2).")
      .def_property_readonly(
          "places",
          [](const Simulation& self) {
            const auto all = self.instruments();
            return HandsOf(all.size(), [&](std::size_t k) { return all[k].hand; });
          },
          "Reached hand positions, shape (instruments, 2).")
      .def_property_readonly(
          "tips_mm",
          [](const Simulation& self) {
            std::vector<torquer::Point> tips;
            for (const auto& instrument : self.instruments()) tips.push_back(instrument.tip_mm);
            return ToRows(tips);
          },
          "Tips of the instruments, shape (instruments, 3).")
      .def_property_readonly("energy_mJ", &Simulation::energy_mJ)
      .def_property_readonly("dissipated_mJ", &Simulation::dissipated_mJ,
                             "Dissipated energy, which energy_mJ does not include.")
      .def_property_readonly("residual", &Simulation::residual)
      .def_property_readonly("max_penetration_mm", &Simulation::max_penetration_mm)
      .def_property_readonly("outside_lumen", &Simulation::outside_lumen)
      .def_property_readonly("state_hash", &Simulation::state_hash,
                             "Hash of everything that determines the further simulation.")
      .def("solver_error_mm", &Simulation::SolverErrorMm, NoGil(),
           "Estimated distance of the wire from the fully relaxed wire.")
      .def("discretization_error_mm", &Simulation::DiscretizationErrorMm, NoGil(),
           "Estimated distance of the wire from the limit of ever finer segments; nan with wall "
           "contact, torsion, friction, inertia or clearance.")
      .def(
          "readings",
          [](const Simulation& self) { return torquer::python::ToReadings(self.readings()); },
          "Readings of the scene's observers by name, which ends with the unit; nan: not known.")
      .def("record", &Simulation::Record,
           "Record of the session as JSON, as torquer-simulator --record writes it.")
      .def(
          "contacts", [](const Simulation& self) { return ToDict(self.contacts()); },
          "Penetrations of the wall in mm, by the node of nodes_mm at the end of the segment in "
          "contact.")
      .def(
          "instrument_contacts",
          [](const Simulation& self, std::size_t instrument) {
            return ToDict(self.InstrumentContacts(instrument));
          },
          py::arg("instrument"),
          "The same along the curve of an instrument up to its tip, by the node of "
          "instrument_nodes_mm.")
      .def(
          "forces", &ForcesOf,
          "Forces along the wire, one entry per node of nodes_mm. Needs [effects.internal_forces].")
      .def("track_sensitivities", &Simulation::TrackSensitivities, py::arg("keys"), NoGil(),
           "Tracks the derivatives of the states by these keys of the scene from its start on; an "
           "empty list ends it. Only before the first step or after restart(). A key is a number, "
           "or a list of numbers, of an instrument or an effect, or vessel.wall_stiffness_N_mm2. "
           "The states stay those without tracking. Copies track too, pickles do not.")
      .def("sensitivities", &torquer::python::SensitivitiesOf,
           "Derivatives of the present state by the tracked keys: a Sensitivity for each key. With "
           "friction or inertia they include the effect of the way from the start.")
      .def("places_in_picture", &PlacesOf, py::arg("points_mm"), py::arg("plane") = 0,
           "Columns and rows of points, shape (n, 3), in a picture of a plane that is taken now, "
           "at the angles and the magnification of the last step; shape (n, 2). Pixel (0, 0) is "
           "centered at 0, 0, top left. nan for a point that is not in front of the X-ray source.")
      .def("picture_due", &Simulation::picture_due, py::arg("plane") = 0,
           "True if a picture was taken that picture() has not returned yet.")
      .def("picture", &PictureOf, py::arg("plane") = 0,
           "Last X-ray picture, shape (height, width), uint8; None before the first picture. It "
           "needs [effects.fluoroscopy]; plane 1 belongs to [effects.lateral_plane].")
      .def_property_readonly("picture_planes", &Simulation::picture_planes,
                             "Number of planes that take X-ray pictures.");
}

}  // namespace

PYBIND11_MODULE(_torquer, module) {
  module.doc() = "Simulation of guidewires and catheters in a patient's arteries.";
  module.attr("__version__") = torquer::Version();
  module.attr("__build__") = torquer::Build();
  py::register_exception<torquer::Error>(module, "Error", PyExc_ValueError);
  torquer::python::AddScene(module);
  torquer::python::AddUnits(module);
  torquer::python::AddSurface(module);
  torquer::python::AddSensitivity(module);
  torquer::python::AddControls(module);
  AddSimulation(module);
  torquer::python::AddNavigation(module);
}
