// Torquer library: simulates guidewires and catheters in a patient's arteries.
//
//   torquer::Scene scene = torquer::Scene::FromFile("neuro_arch.toml");
//   torquer::Simulation simulation(scene);
//   torquer::Command command = simulation.command();
//   for (int k = 1; k <= 100; ++k) {
//     command.time_s = 0.1 * k;
//     command.hands[0].insertion_mm += 1;
//     simulation.Step(command);
//   }
//   simulation.nodes_mm();  // shape of the wire
//
// Lengths are in mm, angles in rad, angles of the C-arm in degrees, times in s. Positions are in
// the frame of the vessel's file. The same commands give the same states, bit for bit. Only one
// thread may use a simulation at a time; a second one is refused. Simulations of one scene may run
// in parallel threads.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <limits>
#include <memory>
#include <stdexcept>
#include <string>
#include <utility>
#include <variant>
#include <vector>

#if defined(__GNUC__)
#define TORQUER_API __attribute__((visibility("default")))
#else
#define TORQUER_API
#endif

namespace torquer {

/// Version of the library, such as "0.1.0".
TORQUER_API const char* Version();

/// Identity of the library's build: two builds of the same code have the same. Another build may
/// find other states.
TORQUER_API std::string Build();

/// Error of all calls here: an argument or a file is not usable. Its what() names the file, line or
/// field, the value and the remedy. A call that throws it has no other effect.
class TORQUER_API Error : public std::runtime_error {
 public:
  explicit Error(const std::string& message);
  ~Error() override;
};

/// x, y, z, mm.
using Point = std::array<double, 3>;

/// Insertion and rotation of an instrument.
struct Hand {
  double insertion_mm = 0;  ///< past the entry point, >= 0
  double rotation_rad = 0;
};

/// An instrument of a scene.
struct InstrumentInfo {
  std::string name;
  double max_length_mm = 0;
  double tip_radius_mm = 0;
  double inner_radius_mm = 0;  ///< radius of the lumen; 0: solid
  Hand start;
  bool is_beside = false;  ///< lies beside the earlier instruments, with [instrument.entry]
};

/// Surface of a lumen as a scene uses it: repaired, its open ends closed flat.
struct TORQUER_API Surface {
  std::vector<Point> points_mm;
  /// Numbers of points, counterclockwise as seen from outside.
  std::vector<std::array<std::int32_t, 3>> triangles;
  /// Defects that were found and repaired, one sentence each.
  std::vector<std::string> findings;
  /// "LPS" or "RAS" if the file names its coordinate system, as 3D Slicer does; otherwise empty.
  std::string space;

  /// Reads an STL, OBJ or PLY file. `mesh_unit`: unit of its coordinates, as in a scene: mm, m, cm,
  /// um or in. Throws Error if the surface cannot be repaired, naming the place and the remedy.
  static Surface FromFile(const std::string& path, const std::string& mesh_unit);
  /// As FromFile, from triangles in that unit; they may be open and face either way. `name` stands
  /// for the file in messages. Throws Error also for a number of no point, and at a point that is
  /// not finite.
  static Surface FromTriangles(const std::vector<Point>& points,
                               const std::vector<std::array<std::int32_t, 3>>& triangles,
                               const std::string& name, const std::string& mesh_unit);
};

/// Result of CheckSurface.
struct SurfaceCheck {
  bool is_usable = false;  ///< a scene can have the surface
  std::string text;        ///< findings for a person, line by line
  std::string proposal;    ///< tables [vessel] and [entry] of a scene; "" if it is not usable
};
/// Checks a surface file as torquer-simulator --check-mesh does. Throws Error if it cannot be read.
TORQUER_API SurfaceCheck CheckSurface(const std::string& path);

/// Value for a key of a scene: true or false, a number, a text, or a list. With std::monostate the
/// key is removed, so that its default is valid.
using Value = std::variant<std::monostate, bool, std::int64_t, double, std::string,
                           std::vector<double>, std::vector<std::string>, std::vector<Point>>;
/// Full keys of a scene with their values, set in this order. Examples of keys are
/// "effects.friction.coefficient" and, for the instrument of that name,
/// "instrument.guidewire.radius_mm". Without a name in the file it has its number, from 0. For
/// "effects.NAME", true adds the effect with its defaults, and false removes it.
using Values = std::vector<std::pair<std::string, Value>>;

struct ScriptRow;
/// Checked contents of a scene file, with its vessel. Copies are cheap and share the data.
class TORQUER_API Scene {
 public:
  /// Reads a scene file, or a scene of Torquer by its name, and opens the files that it names.
  /// Takes seconds for a large surface, less if an earlier run has cached its field.
  static Scene FromFile(const std::string& path);
  /// Reads the text of a scene file; `folder` is the base of relative paths. Messages name `path`
  /// as its file.
  static Scene FromText(const std::string& toml, const std::string& folder,
                        const std::string& path = "scene");
  /// The scene with other values of some keys. Messages about the other keys have the lines of the
  /// file. Shares the vessel unless a key of it changes, so it takes milliseconds.
  Scene With(const Values& values) const;

  Scene(const Scene&);
  Scene& operator=(const Scene&);
  ~Scene();

  const std::string& name() const;
  /// Path of the file, or that given to FromText.
  const std::string& path() const;
  /// Text of a scene file without the keys that have their default. FromText makes the scene again
  /// from text() and folder().
  std::string text() const;
  const std::string& folder() const;
  /// Hash of the text without [case], and of the files that it names.
  std::uint64_t content_hash() const;
  /// Instruments, the innermost first.
  const std::vector<InstrumentInfo>& instruments() const;
  std::vector<std::string> effects() const;
  /// Defects that were found in the vessel's file and repaired, one sentence each.
  const std::vector<std::string>& findings() const;

  /// Reads the text of a script for this scene. Messages name `path` as its file.
  std::vector<ScriptRow> ParseScript(const std::string& csv,
                                     const std::string& path = "script") const;

  /// Caches the part of the vessel's field built so far, for the next program that opens the scene.
  /// The last copy of the scene does so when it is destroyed. Returns the reason of a failure;
  /// empty after success, or without new data.
  std::string KeepField() const;

  /// Minimum and maximum corner of a box around the vessel.
  std::array<Point, 2> bounds_mm() const;
  /// Distance from the wall, mm: positive in the lumen, negative outside. It is exact within about
  /// 3 mm of the wall, and a lower bound farther inside.
  double ClearanceMm(const Point& point_mm) const;
  /// Surface of the lumen at rest. Throws Error if the scene's vessel does not come from a surface.
  Surface surface() const;
  /// Names of the centerlines; empty if the scene has no file of them.
  std::vector<std::string> centerlines() const;
  /// Points along a centerline, `step_mm` (> 0) apart, with its end; a million at most.
  std::vector<Point> CenterlineMm(const std::string& name, double step_mm) const;
  /// Points along the shortest way from the entry point of an instrument to a place on a
  /// centerline, as CenterlineMm. `at_mm`: distance of the place from the centerline's start.
  std::vector<Point> RouteMm(const std::string& centerline, double at_mm, double step_mm,
                             std::size_t instrument = 0) const;

 private:
  friend class Simulation;
  struct Impl;
  explicit Scene(std::shared_ptr<const Impl> impl);

  std::shared_ptr<const Impl> impl_;
};

/// Position of a wedge filter: 0.5 mm of copper, whose edge comes in across the picture.
struct Wedge {
  double share = 0;         ///< of the picture that its edge has crossed; 0 (out) to 0.5
  double rotation_deg = 0;  ///< clockwise in the picture; -90 to 90
};

/// Settings of the X-ray system. They have an effect only with [effects.fluoroscopy].
struct Imaging {
  enum class Mode : std::uint8_t {
    kAsScene,      ///< `mode` of the scene
    kPlain,        ///< image of the detector
    kSubtraction,  ///< minus the first picture since the pedal was pressed
    kRoadmap,      ///< kSubtraction, with the densest dye so far as a bright map
    kCine          ///< kPlain, with the dose of an acquisition
  };
  Mode mode = Mode::kAsScene;
  double pulses_per_s = 0;   ///< 1 to 60; 0: value of the scene
  double magnification = 1;  ///< 1 to 4: the field is narrower by this factor
  /// Fraction of the picture that each shutter covers, 0 to 0.45.
  double left = 0, right = 0, top = 0, bottom = 0;
  Wedge wedge_left = {};   ///< at 0 deg it comes in from the left
  Wedge wedge_right = {};  ///< at 0 deg it comes in from the right
};

/// Throws Error for settings that a step refuses.
TORQUER_API void CheckImaging(const Imaging& imaging);

/// Displacement of the table, and of the patient on it, since the start. The C-arm stays. It has an
/// effect only with [effects.fluoroscopy].
struct Table {
  double left_mm = 0;    ///< to the patient's left; -150 .. 150
  double head_mm = 0;    ///< towards the patient's head; -500 .. 500
  double height_mm = 0;  ///< to the patient's front, which is up; -150 .. 150
};

/// Order to the power injector, and its set-up. Both need injector_volume_mL in [effects.contrast].
/// An order kArm after another order arms it for one injection. An order kInject then starts that.
/// Any other order stops it at once, and it must be armed again.
struct Injector {
  enum class Order : std::uint8_t { kOff, kArm, kInject };
  Order order = Order::kOff;
  double volume_mL = -1;  ///< 0.1 to 150; -1, here and below: value of the scene
  double rate_mL_s = -1;  ///< 0.1 to 45
  double delay_s = -1;    ///< from the order to the first agent, 0 to 99.9
  double rise_s = -1;     ///< time in which the rate rises from 0 to its value, 0 to 9.9
};

/// Throws Error for an order or a set-up that a step refuses.
TORQUER_API void CheckInjector(const Injector& injector);

/// Command of the hands and feet for a time.
struct Command {
  double time_s = 0;        ///< since the start; ascending, the first one >= 0
  std::vector<Hand> hands;  ///< one for each instrument; |each| <= 1e5, insertions >= 0
  double lao_deg = 0;       ///< C-arm angle, positive to the patient's left; -180 .. 180
  double cra_deg = 0;       ///< C-arm angle, positive towards the head; -180 .. 180
  bool xray = false;
  bool contrast = false;
  Imaging imaging = {};
  Table table = {};
  Injector injector = {};
};

/// Row of a script, as torquer-simulator --script takes it.
struct ScriptRow {
  std::string place;  ///< file and line
  double time_s = 0;  ///< in the file
  /// Exchanges before the motion: the number of an instrument, and its device of host/devices.
  std::vector<std::pair<std::size_t, std::string>> exchanges;
  Command command;  ///< its time is since the first row
};

/// Report of a step, or of one tick.
struct StepReport {
  int ticks = 0;              ///< number of ticks in the step; 1 for a tick
  int iterations = 0;         ///< of the relaxation
  int work = 0;               ///< units of the budget
  bool converged = false;     ///< relaxed to the scene's tolerance
  bool budget_spent = false;  ///< the budget ended the last tick: motion is carried over
  bool stalled = false;       ///< ended out of balance: no step came nearer to it
  bool snapped = false;       ///< a tip moved much farther than the hands, in a tick
  bool finished = true;       ///< false: `after_tick` ended the step early
};

/// State of an instrument.
struct InstrumentState {
  Hand hand;     ///< place that was reached
  Hand carried;  ///< commanded motion that is left for the next step
  Point tip_mm;
};

/// Contact of the wire with the wall: a segment, and its deepest point.
struct Contact {
  std::size_t node = 0;       ///< node at the segment's end, towards the tip
  double penetration_mm = 0;  ///< of the wire's surface into the wall, > 0
};

struct Reading {
  std::string name;  ///< ends with its unit, as in force_tip_mN
  double value = 0;  ///< NaN: not known
};

/// Forces along the wire at every node of Simulation::nodes_mm(). NaN: not known, because the last
/// tick did not converge.
struct Forces {
  std::vector<Point> contact_mN;        ///< force of the wall on the wire
  std::vector<double> line_load_mN_mm;  ///< load of the wall
  std::vector<double> tension_mN;       ///< negative: compression
  std::vector<double> bending_mN_mm;    ///< moment
  std::vector<double> twisting_mN_mm;   ///< moment
};

/// Derivatives of the state by a number of the scene.
struct Sensitivity {
  std::string key;
  /// Number of the key in the scene. For a list of several numbers 1: the derivatives are by their
  /// common factor.
  double value = 0;
  /// Reason for which the derivatives of the present state are not known; empty if they are.
  std::string unknown;
  /// End of the tick since which they have not been known, and the reason after that tick. Friction
  /// and inertia remember the way, so the first reason can be another one. NaN and empty if they
  /// are known.
  double unknown_since_s = std::numeric_limits<double>::quiet_NaN();
  std::string first_unknown;
  /// Derivatives of Simulation::nodes_mm(), mm per unit of the key. Empty if they are not known.
  std::vector<Point> nodes_mm;
  /// Derivatives of InstrumentState::tip_mm of each instrument. Empty if they are not known.
  std::vector<Point> tips_mm;
  /// Derivatives of Simulation::readings(), without those of effects that evolve by themselves.
  /// NaN: not known. Empty if no derivative is known.
  std::vector<Reading> readings;
};

/// Place in a picture: pixel (0, 0) is centered at column 0, row 0, top left. NaN for a point that
/// is not in front of the X-ray source.
struct PicturePlace {
  double column = 0;
  double row = 0;
};

/// An X-ray picture.
struct Picture {
  int width = 0;  ///< 0: no picture was taken yet
  int height = 0;
  double time_s = 0;
  double lao_deg = 0;
  double cra_deg = 0;
  std::vector<std::uint8_t> gray;  ///< width * height, row by row from the top left
};

/// A running scene. A moved-from object refuses all calls except assignment. A copy continues on
/// its own from the state of the original: this saves a state, and assignment restores it.
/// Assignment within one scene only copies values, and is fast.
class TORQUER_API Simulation {
 public:
  /// Begins at the start of the scene.
  explicit Simulation(const Scene& scene);
  Simulation(const Simulation& other);
  Simulation& operator=(const Simulation& other);
  Simulation(Simulation&&) noexcept;
  Simulation& operator=(Simulation&&) noexcept;
  ~Simulation();

  /// Bytes from which Load restores this simulation. They have the commands since the start, and
  /// the names of exchanged devices.
  std::string Save() const;
  /// Makes a saved simulation again, by repeating its commands. `scene` must have the contents of
  /// the saved simulation's scene_at_start(). The result continues as the saved one does, bit for
  /// bit; this is checked by the hash of the state. `after_tick` is called after each tick, and
  /// ends the work if it throws. Refuses damaged bytes, and those of another Build().
  static Simulation Load(const Scene& scene, const std::string& saved,
                         const std::function<void()>& after_tick = {});

  /// The scene, with the devices of Exchange. Valid until the next exchange, restart or assignment.
  const Scene& scene() const;
  /// The scene with which the simulation began: that for Load.
  const Scene& scene_at_start() const;
  /// Returns to the start of scene_at_start().
  void Restart();
  /// Exchanges an instrument for a device of host/devices, between two steps. It can be a catheter
  /// over a resting wire, or a wire in a resting catheter. The instrument must be withdrawn to 0
  /// mm. It keeps its name, length and hand, and has no other key of the scene. All else goes on as
  /// it is: shapes, friction, time, blood flow, pictures, readings. Copies and saved simulations
  /// have the exchange too. Throws Error if the device does not fit, or if derivatives are tracked.
  void Exchange(const std::string& instrument, const std::string& device);
  /// Advances to a command; the hands move linearly from the command before. A step is divided into
  /// ticks like a row of a script (torquer-simulator --script). Both get the same states.
  StepReport Step(const Command& command);
  /// Calls `after_tick` after each tick with its report: to take each picture, show progress, or
  /// end the step. It may read this simulation and take its pictures, but not move it. If it
  /// returns false or throws, the step ends. Then command() is the place that was reached, and the
  /// next step starts there.
  StepReport Step(const Command& command,
                  const std::function<bool(const StepReport& tick)>& after_tick);
  /// Carries out the exchanges of a script's row, and then its command as Step does. An exchange
  /// stays if a later one of the row is refused.
  StepReport StepRow(const ScriptRow& row,
                     const std::function<bool(const StepReport& tick)>& after_tick = {});
  /// Command of the last tick, or that of the start.
  const Command& command() const;

  /// Calls `look` while no thread moves this simulation. The data of nodes_mm(), command() and
  /// LastPicture() does not change until `look` returns.
  void WhileStill(const std::function<void()>& look) const;

  double time_s() const;
  /// Nodes of the combined wire of all instruments: x, y, z of each, from the entry point to the
  /// tip. Has node_count() * 3 values, valid until the next step, restart or assignment. With
  /// [effects.clearance] or [instrument.entry] the instruments lie on several curves. These are
  /// then the nodes of the curve that reaches farthest, which may change in a step.
  const double* nodes_mm() const;
  std::size_t node_count() const;
  /// Nodes of an instrument on its curve, from its entry point to its tip; number 0 is the
  /// innermost.
  std::vector<Point> InstrumentNodesMm(std::size_t instrument) const;
  /// States of the instruments, the innermost first.
  std::vector<InstrumentState> instruments() const;
  double energy_mJ() const;      ///< of bending, wall and effects, without the dissipated part
  double dissipated_mJ() const;  ///< by friction since contacts stuck, and by steps of inertia
  double residual() const;       ///< largest out-of-balance moment over the local EI/(1 mm)
  /// Estimated distance of a node from its fully relaxed position; NaN if near no minimum.
  double SolverErrorMm();
  /// Estimated distance of a node from its position with ever finer segments. NaN if the wire
  /// touches the wall, twists, or has friction, inertia or room in a lumen.
  double DiscretizationErrorMm();
  double max_penetration_mm() const;  ///< of the wire's surface into the wall
  bool outside_lumen() const;         ///< true if the center curve of an instrument leaves it
  /// Contacts of the curve of nodes_mm(), from the entry point to its tip, at most one for each
  /// segment. `node` counts in nodes_mm(). With several curves, InstrumentContacts has all.
  std::vector<Contact> contacts() const;
  /// Contacts of the curve of an instrument up to its tip. `node` counts in InstrumentNodesMm().
  std::vector<Contact> InstrumentContacts(std::size_t instrument) const;
  std::uint64_t state_hash() const;  ///< of everything that decides the further motion
  /// Readings of the observers of the scene; see host/simulator/effects/README.md.
  std::vector<Reading> readings() const;
  /// Record of the session as JSON, with the readings, as torquer-simulator --record writes it.
  std::string Record() const;
  /// Forces along the curve of nodes_mm(). Throws Error without [effects.internal_forces].
  Forces forces() const;
  /// Tracks the derivatives of the states by these keys of the scene, in place of earlier ones;
  /// none: no tracking. Only at the start: before the first step, or after Restart. A key has a
  /// number or a list of numbers. It belongs to an instrument or an effect, or is
  /// "vessel.wall_stiffness_N_mm2". The states stay those without tracking. Copies track too, but
  /// Save and Load do not. Throws Error for a key without derivatives. There are none with several
  /// curves, with friction between instruments, or by the paper's method.
  void TrackSensitivities(const std::vector<std::string>& keys);
  /// Derivatives of the present state by the tracked keys, in their order. With friction or inertia
  /// they include the effect of the way from the start.
  std::vector<Sensitivity> sensitivities() const;
  int picture_planes() const;  ///< 0 without [effects.fluoroscopy], 2 with [effects.lateral_plane]
  /// True if a plane has a new picture that LastPicture has not returned yet. A step may take
  /// several, and LastPicture returns the last one: see `after_tick`.
  bool picture_due(int plane = 0) const;
  /// Places of points in a picture of a plane that is taken now. Angles and magnification are those
  /// of command(). Needs [effects.fluoroscopy].
  std::vector<PicturePlace> PlacesInPicture(const std::vector<Point>& points_mm,
                                            int plane = 0) const;
  /// Renders and returns the last X-ray picture of a plane. Needs [effects.fluoroscopy].
  const Picture& LastPicture(int plane = 0);

 private:
  struct Impl;
  Impl& impl() const;

  std::unique_ptr<Impl> impl_;
};

}  // namespace torquer
