// Torquer: guidewires and catheters in a patient's arteries, for programs.
//
//   torquer::Scene scene = torquer::Scene::FromFile("neuro_arch.toml");
//   torquer::Simulation simulation(scene);
//   torquer::Command command = simulation.command();
//   for (int k = 1; k <= 100; ++k) {
//     command.time_s = 0.1 * k;
//     command.hands[0].insertion_mm += 1;
//     simulation.Step(command);
//   }
//   simulation.nodes_mm();  // where the wire lies
//
// Lengths are in mm, angles in rad (those of the C-arm in degrees), times in s, in the frame of the
// vessel's file. The same commands give the same states, bit for bit. One simulation belongs to one
// thread at a time, and refuses a second; simulations of one scene may run in threads beside each
// other.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <memory>
#include <stdexcept>
#include <string>
#include <vector>

#if defined(__GNUC__)
#define TORQUER_API __attribute__((visibility("default")))
#else
#define TORQUER_API
#endif

namespace torquer {

/// The version of the library, as "0.1.0".
TORQUER_API const char* Version();

/// Something that was given cannot be used. what() names the file, line or field, the value and the
/// remedy. All that can fail here throws it; what throws has changed nothing.
class TORQUER_API Error : public std::runtime_error {
 public:
  explicit Error(const std::string& message);
  ~Error() override;
};

/// x, y, z, mm.
using Point = std::array<double, 3>;

/// Where a hand has brought its instrument.
struct Hand {
  double insertion_mm = 0;  ///< past the entry point, >= 0
  double rotation_rad = 0;
};

/// An instrument of a scene.
struct InstrumentInfo {
  std::string name;
  double max_length_mm = 0;
  double tip_radius_mm = 0;
  double inner_radius_mm = 0;  ///< of its lumen; 0: solid
  Hand start;
};

/// What a scene file says, read and checked, with its vessel. Cheap to copy: copies share it.
class TORQUER_API Scene {
 public:
  /// Reads a scene file, or the scene of that name that Torquer has, and opens what it names. Takes
  /// seconds for a large surface, less when an earlier run has cached its field.
  static Scene FromFile(const std::string& path);
  /// The same of the text of a scene file; paths in it are relative to `folder`.
  static Scene FromText(const std::string& toml, const std::string& folder);

  Scene(const Scene&);
  Scene& operator=(const Scene&);
  ~Scene();

  const std::string& name() const;
  /// Of its file; "scene" where it was made of a text.
  const std::string& path() const;
  /// All keys of the scene with their values, as a scene file: FromText makes it again, in
  /// folder().
  std::string text() const;
  const std::string& folder() const;
  /// Of the text and of the files that it names.
  std::uint64_t content_hash() const;
  /// The innermost first.
  const std::vector<InstrumentInfo>& instruments() const;
  std::vector<std::string> effects() const;
  /// What was found in the vessel's file and repaired, one sentence each.
  const std::vector<std::string>& findings() const;

  /// What was built of the vessel's field is kept for the next program that opens the scene, when
  /// the last copy of this one goes. This keeps it now, and returns why it cannot be kept: empty
  /// where it is, or where there is nothing new.
  std::string KeepField() const;

  /// Two corners of a box around the vessel.
  std::array<Point, 2> bounds_mm() const;
  /// Distance from the wall, mm: positive in the lumen, negative beyond; exact within about 3 mm of
  /// the wall, a lower bound farther inside.
  double ClearanceMm(const Point& point_mm) const;
  /// Names of the centerlines; none where the scene has no file of them.
  std::vector<std::string> centerlines() const;
  /// Points along a centerline, `step_mm` (> 0) apart, its end included; a million at most.
  std::vector<Point> CenterlineMm(const std::string& name, double step_mm) const;
  /// The same along the shortest way from the entry point to a place on a centerline, `at_mm` from
  /// its start.
  std::vector<Point> RouteMm(const std::string& centerline, double at_mm, double step_mm) const;

 private:
  friend class Simulation;
  struct Parts;
  explicit Scene(std::shared_ptr<const Parts> parts);

  std::shared_ptr<const Parts> parts_;
};

/// What is chosen on the X-ray system. Needs [effects.fluoroscopy] to be seen.
struct Imaging {
  enum class Mode : std::uint8_t {
    kAsScene,      ///< as its `mode` says
    kPlain,        ///< as the detector sees it
    kSubtraction,  ///< less the first picture since the pedal went down
    kRoadmap,      ///< that, with the densest dye so far as a bright map
  };
  Mode mode = Mode::kAsScene;
  double pulses_per_s = 0;   ///< 1 to 60; 0: as the scene has it
  double magnification = 1;  ///< 1 to 4: how many times narrower the field is
  /// Share of the picture that each shutter covers, 0 to 0.45.
  double left = 0;
  double right = 0;
  double top = 0;
  double bottom = 0;
};

/// What the hands and feet want at a time.
struct Command {
  double time_s = 0;        ///< since the start; ascending, the first one >= 0
  std::vector<Hand> hands;  ///< one an instrument; |each| <= 1e5
  double lao_deg = 0;       ///< of the C-arm, positive to the patient's left; -180 .. 180
  double cra_deg = 0;       ///< positive towards the head; -180 .. 180
  bool xray = false;
  bool contrast = false;
  Imaging imaging = {};
};

/// How a step went, or a tick of it.
struct StepReport {
  int ticks = 0;              ///< that it was cut into; of a tick: 1
  int iterations = 0;         ///< of the relaxation
  int work = 0;               ///< units of the budget
  bool converged = false;     ///< relaxed to the scene's tolerance
  bool budget_spent = false;  ///< the budget ended its last tick: motion is carried over
  bool stalled = false;       ///< ended out of balance: no step came nearer to it
  bool snapped = false;       ///< the tip went much farther than the hands, in one of its ticks
  bool finished = true;       ///< false: `after_tick` ended it before its time
};

/// Where an instrument is.
struct InstrumentState {
  Hand hand;     ///< as far as it was carried out
  Hand carried;  ///< what was asked for and is left for the next step
  Point tip_mm;
};

/// Where the wire is pressed against the wall: in a segment, with the deepest of its points.
struct Contact {
  std::size_t node = 0;       ///< the one at the segment's end, towards the tip
  double penetration_mm = 0;  ///< of the wire's surface into the wall, > 0
};

struct Reading {
  std::string name;  ///< with its unit at the end, as in force_tip_mN
  double value = 0;
};

/// Along the wire, of every node (node 0 is at the entry point).
struct Forces {
  std::vector<Point> contact_mN;        ///< of the wall on the wire
  std::vector<double> line_load_mN_mm;  ///< of the wall
  std::vector<double> tension_mN;       ///< negative: compression
  std::vector<double> bending_mN_mm;    ///< moment
  std::vector<double> twisting_mN_mm;   ///< moment
};

/// An X-ray picture.
struct Picture {
  int width = 0;  ///< 0: none was taken yet
  int height = 0;
  double time_s = 0;
  double lao_deg = 0;
  double cra_deg = 0;
  std::vector<std::uint8_t> gray;  ///< width * height, row by row from the top left
};

/// A scene as it goes on. One that was moved from refuses all but assignment. Copies go on by
/// themselves from where the original was, which is how a state is saved and restored; assignment
/// within one scene takes no time to build.
class TORQUER_API Simulation {
 public:
  /// At the start of the scene.
  explicit Simulation(const Scene& scene);
  Simulation(const Simulation& other);
  Simulation& operator=(const Simulation& other);
  Simulation(Simulation&&) noexcept;
  Simulation& operator=(Simulation&&) noexcept;
  ~Simulation();

  const Scene& scene() const;
  /// Back to the start.
  void Restart();
  /// Goes on to a command; the hands move evenly from the one before. A step is cut into ticks as a
  /// row of a script is (torquer-simulator --script), so that both get the same states.
  StepReport Step(const Command& command);
  /// The same, and calls `after_tick` when a tick has been, with how it went: to take each picture,
  /// to show how far a long step is, to end it. It may look at this simulation, and take pictures
  /// of it, but not move it. Where it returns false, or throws, the step ends there: command() is
  /// then where the hands have come, and the next step goes on from there.
  StepReport Step(const Command& command,
                  const std::function<bool(const StepReport& tick)>& after_tick);
  /// The last one, or that of the start.
  const Command& command() const;

  /// Calls `look` while no thread moves this: what nodes_mm(), command() and LastPicture() refer to
  /// stays as it is until `look` returns.
  void WhileStill(const std::function<void()>& look) const;

  double time_s() const;
  /// The nodes of the wire that all instruments are together, x, y, z of each, from the entry point
  /// to the tip: node_count() * 3 values, good until the next step, restart or assignment.
  const double* nodes_mm() const;
  std::size_t node_count() const;
  /// Along an instrument, the innermost being number 0, from the entry point to its tip. All lie on
  /// the curve of nodes_mm() but with [effects.clearance], which gives them two.
  std::vector<Point> InstrumentNodesMm(std::size_t instrument) const;
  /// The innermost first.
  std::vector<InstrumentState> instruments() const;
  double energy_mJ() const;      ///< of bending, wall and effects, without what is dissipated
  double dissipated_mJ() const;  ///< by friction since contacts stuck, and by steps of inertia
  double residual() const;       ///< largest out-of-balance moment over the local EI/(1 mm)
  /// About how far the wire is from where relaxing to the end would bring it; NaN near no minimum.
  double SolverErrorMm();
  /// About how far it is from where it would be with ever finer segments; NaN where it touches the
  /// wall, twists, or has friction, inertia or room in a lumen.
  double DiscretizationErrorMm();
  double max_penetration_mm() const;  ///< of the wire's surface into the wall
  bool outside_lumen() const;         ///< whether a part of the wire's middle line is
  /// From the entry point to the tip, one a segment at most.
  std::vector<Contact> contacts() const;
  std::uint64_t state_hash() const;  ///< of all that decides how it goes on
  /// What the observers of the scene have found; see host/simulator/effects/README.md.
  std::vector<Reading> readings() const;
  /// The record of the session, as torquer-simulator --record writes it: JSON, with the readings.
  std::string Record() const;
  /// Empty where the scene has no [effects.internal_forces].
  Forces forces() const;
  int picture_planes() const;  ///< 0 without [effects.fluoroscopy], 2 with [effects.lateral_plane]
  /// Whether a picture was taken in a plane that LastPicture has not given yet. A step may take
  /// several, of which the last is given: see `after_tick`.
  bool picture_due(int plane = 0) const;
  /// The last X-ray picture of a plane, rendered when it is asked for. Needs [effects.fluoroscopy].
  const Picture& LastPicture(int plane = 0);

 private:
  struct Parts;
  Parts& parts() const;

  std::unique_ptr<Parts> parts_;
};

}  // namespace torquer
