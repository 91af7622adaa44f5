// Effect interface: the roles through which an effect takes part in a simulation.
//
// An effect is one file pair and one line in registry.cpp. It exists only in scenes that name it;
// the relaxation knows roles, never effects.
#pragma once

#include <Eigen/Core>
#include <Eigen/Geometry>
#include <any>
#include <array>
#include <cstdint>
#include <filesystem>
#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "host/simulator/core/energy_term.h"
#include "host/simulator/core/instrument_pose.h"
#include "host/simulator/core/internal_forces.h"
#include "host/simulator/core/relaxation.h"
#include "host/simulator/core/stack/hand_forces.h"
#include "host/simulator/core/stack/instrument_stack.h"
#include "host/simulator/core/wire_mechanics.h"
#include "host/simulator/core/wire_model.h"
#include "host/simulator/core/wire_state.h"
#include "host/simulator/effects/values_along.h"
#include "host/simulator/vessel/centerline.h"
#include "host/simulator/vessel/moving_field.h"
#include "host/simulator/vessel/patient_axes.h"
#include "host/simulator/vessel/vessel.h"
#include "host/support/key_table.h"

namespace torquer::effects {

class Effect;
struct VitalSigns;

/// Properties of an instrument for the effects, besides its mechanics.
struct Instrument {
  std::string name;
  const WireModel* model = nullptr;
  double inner_radius_mm = 0;  ///< of its lumen; 0: solid
  /// On the wall; empty: that of the friction effect.
  std::optional<ValuesAlong> friction_coefficient = {};
  double coating_mm = 0;           ///< length of the coated end
  double coating_coefficient = 0;  ///< friction coefficient of the coated end
  double linear_density_g_m = 0;   ///< less the density of the displaced blood
  double attenuation_1_mm = 0.8;   ///< of X-rays in its material
  double marker_mm = 0;            ///< length of its opaque distal part
  double marker_1_mm = 0;          ///< attenuation of that part
};

/// Index of the instrument with a name. Throws UserError for `key` of the table if no instrument
/// has it.
int FindInstrument(const std::vector<Instrument>& instruments, const std::string& name,
                   const TableSpec& spec, const std::string& key);

/// Inputs for the construction of effects. All outlive the effect. A bench without a scene leaves
/// some null or empty.
struct EffectContext {
  const WireModel& wire;  ///< the empty rod of the innermost curve
  const WallModel& wall;
  const ClearanceField* field = nullptr;  ///< the vessel at rest
  const vessel::CenterlineNetwork* centerlines = nullptr;
  Eigen::AlignedBox3d bounds_mm = {};  ///< of the vessel
  vessel::PatientAxes axes = {};
  const std::vector<std::unique_ptr<Effect>>* earlier = nullptr;  ///< effects made before this one
  const vessel::MovingField* moving = nullptr;  ///< the moving vessel; null for a vessel at rest
  std::vector<Instrument> instruments = {};     ///< the innermost first
  const InstrumentStack* stack = nullptr;       ///< the stack of `instruments`
  const vessel::Vessel* vessel = nullptr;       ///< the vessel at rest, with its surface
  std::filesystem::path folder = {};            ///< base of relative paths
  /// The effect of this name in a scene that shares the vessel, its axes and the folder; null for
  /// none. The new effect may share the contents of files with it.
  const Effect* other = nullptr;

  /// Index of the instrument with a name. Throws UserError for `key` of the table if no instrument
  /// has it.
  int FindInstrument(const std::string& name, const TableSpec& spec, const std::string& key) const {
    return effects::FindInstrument(instruments, name, spec, key);
  }
  /// Unit direction in the vessel's frame.
  Eigen::Vector3d Direction(const DirectionSpec& spec) const;
};

/// Position of one of the two wedge filters of the X-ray system (imaging/wedge_filters.h). At 0 deg
/// the first one comes in from the left of the picture, the second one from the right.
struct Wedge {
  static constexpr double kMostShare = 0.5;
  static constexpr double kMostRotationDeg = 90;

  double share = 0;         ///< of the picture that its edge has crossed, 0 (out) to kMostShare
  double rotation_deg = 0;  ///< clockwise in the picture, -kMostRotationDeg to kMostRotationDeg
  bool operator==(const Wedge&) const = default;
};

/// Operator's settings of the X-ray system, besides the angles of the C-arm.
struct Imaging {
  enum class Mode : std::uint8_t { kAsScene, kPlain, kSubtraction, kRoadmap, kCine };
  static constexpr double kLeastPulses = 1, kMostPulses = 60;
  static constexpr double kMostMagnification = 4;
  static constexpr double kMostShutter = 0.45;

  Mode mode = Mode::kAsScene;
  double pulses_per_s = 0;   ///< kLeastPulses to kMostPulses; 0: value of the scene
  double magnification = 1;  ///< 1 to kMostMagnification: factor by which the field is narrower
  /// Share of the picture that each shutter covers, 0 to kMostShutter.
  double left = 0, right = 0, top = 0, bottom = 0;
  std::array<Wedge, 2> wedges{};
  bool operator==(const Imaging&) const = default;
};

/// Displacement of the table, and of the patient on it, since the start. The C-arm stays.
struct Table {
  static constexpr double kMostLeftMm = 150, kMostHeadMm = 500, kMostHeightMm = 150;

  double left_mm = 0;    ///< to the patient's left, -kMostLeftMm to kMostLeftMm
  double head_mm = 0;    ///< towards the patient's head, -kMostHeadMm to kMostHeadMm
  double height_mm = 0;  ///< to the patient's front, which is up, -kMostHeightMm to kMostHeightMm
  bool operator==(const Table&) const = default;
};

/// Operator's order to the power injector (blood/power_injector.h), and its set-up.
struct Injector {
  enum class Order : std::uint8_t { kOff, kArm, kInject };
  static constexpr double kAsScene = -1;  ///< value of the scene
  static constexpr double kLeastVolumeML = 0.1, kMostVolumeML = 150;
  static constexpr double kLeastRateMLS = 0.1, kMostRateMLS = 45;
  static constexpr double kMostDelayS = 99.9;
  static constexpr double kMostRiseS = 9.9;

  Order order = Order::kOff;
  double volume_mL = kAsScene;  ///< kLeastVolumeML to kMostVolumeML, or kAsScene
  double rate_mL_s = kAsScene;  ///< kLeastRateMLS to kMostRateMLS, or kAsScene
  double delay_s = kAsScene;  ///< from the order to the first agent: 0 to kMostDelayS, or kAsScene
  double rise_s = kAsScene;   ///< of the rate from 0 to its value: 0 to kMostRiseS, or kAsScene
  bool operator==(const Injector&) const = default;
};

/// Operator's controls besides the motion of the instruments.
struct Controls {
  double lao_rad = 0;  ///< C-arm, positive LAO
  double cra_rad = 0;  ///< C-arm, positive CRA
  bool xray = false;   ///< pedal down
  bool contrast = false;
  Imaging imaging{};
  Table table{};
  Injector injector{};
};

/// View of a tick after its relaxation, for the roles that follow.
struct TickView {
  double time_s = 0;  ///< simulated time since the start
  double step_s = 0;  ///< since the previous tick; 0 at the start
  const Controls& controls;
  const InstrumentPoses& target;
  const WireState& state;
  const QuadraticModel& quadratic;
  const TickReport& report;
  const CombinedRods* rods = nullptr;  ///< of the curves; null if no relaxation made the state
  bool relaxed_at_start = false;  ///< true for the relaxed wire at the start, which has no report

  /// Contact forces are undefined until the solver has converged. False: they are not known.
  bool KnowsForces() const { return report.converged || relaxed_at_start; }
};

/// Number found by an effect, for display and records.
struct Reading {
  std::string name;  ///< ends with the unit, as in force_tip_mN
  double value = 0;  ///< NaN: not known
};

/// Role *timed*: gets the duration of the tick before its relaxation.
class Timed {
 public:
  virtual ~Timed() = default;
  /// `step_s`: simulated time since the previous tick, >= 0.
  virtual void AdvanceTime(double step_s) = 0;
};

/// Role *evolution*: a state that advances once per tick.
class Evolution {
 public:
  virtual ~Evolution() = default;
  virtual void Advance(const TickView& tick) = 0;
};

/// Role *observer*: reads the relaxed state, without changing it.
class Observer {
 public:
  virtual ~Observer() = default;
  virtual void Observe(const TickView& tick) = 0;
  /// Results so far.
  virtual std::vector<Reading> Readings() const = 0;
  /// Results along the wire in the last tick; null for an observer without them.
  virtual const InternalForces* AlongWire() const { return nullptr; }
  /// Hand forces of each instrument, the innermost first; null if AlongWire is null.
  virtual const std::array<HandForce, kMostInstruments>* AtHands() const { return nullptr; }
  /// The patient's curves; null for an observer without them.
  virtual const VitalSigns* Vitals() const { return nullptr; }
};

/// Role *limit*: bounds the motion of a tick. So an instrument stops at a place that the relaxation
/// does not know. Look is called after each part of the motion.
class MotionLimit {
 public:
  virtual ~MotionLimit() = default;
  /// Replaces the targets of instruments that are held by the places where they are held.
  virtual void Hold(InstrumentPoses& target) const = 0;
  /// Limits the targets of the next part of a tick, also as Hold does. Returns true if motion is
  /// left after it.
  virtual bool Limit(const WireState& state, InstrumentPoses& target) const = 0;
  /// Reads the state after a part.
  virtual void Look(const WireState& state) = 0;
  /// True if an instrument has left the model of the vessel, and is held.
  virtual bool left_model() const = 0;
  /// Mixes the memory that changes the motion into a hash.
  virtual std::uint64_t Hash(std::uint64_t seed) const = 0;
};

/// Role *comparison*: compares the state with that of a second run of the scene. Its segments are
/// kSegmentFactor times as long.
class Comparison {
 public:
  static constexpr double kSegmentFactor = 2;
  virtual ~Comparison() = default;
  /// Reads both runs after the same tick, before the observers. They have equally many curves.
  virtual void Compare(const TickView& tick, const TickView& coarse) = 0;
};

/// Role *image*: renders pictures, in its own thread if there is one.
class ImageSource {
 public:
  struct Picture {
    int width = 0;
    int height = 0;
    double time_s = 0;
    Controls controls;
    std::vector<std::uint8_t> gray;  ///< width * height, row by row from the top left
  };
  virtual ~ImageSource() = default;
  /// Runs on the tick thread: stores the contents of the next picture. Cheap. Returns false if no
  /// picture is due.
  virtual bool Take(const TickView& tick) = 0;
  /// Runs on any one thread: renders the picture stored last. Returns false if the previous call
  /// rendered the same one.
  virtual bool Render(Picture& out) = 0;
};

class Effect {
 public:
  Effect() = default;
  Effect(const Effect&) = delete;
  Effect& operator=(const Effect&) = delete;
  virtual ~Effect() = default;

  /// Roles of the effect; null for roles that it does not have.
  virtual EnergyTerm* energy_term() { return nullptr; }
  virtual const WallStiffness* wall_stiffness() { return nullptr; }
  virtual vessel::FieldMotion* motion() { return nullptr; }
  virtual Timed* timed() { return nullptr; }
  virtual Evolution* evolution() { return nullptr; }
  virtual Observer* observer() { return nullptr; }
  virtual ImageSource* image() { return nullptr; }
  virtual MotionLimit* limit() { return nullptr; }
  virtual Comparison* comparison() { return nullptr; }

  /// FNV-1a of the files that the effect has read; 0 for none.
  virtual std::uint64_t FileHash() const { return 0; }
  /// Clears the effect's memory, as at the start. Energy terms have their own Reset.
  virtual void Restart() {}
  /// Copies the memory of `twin`, the same effect of the same scene. Neither effect may be in a
  /// tick, and no picture of either may be in rendering.
  virtual void CopyFrom(const Effect& twin) { static_cast<void>(twin); }
};

/// Earlier effect of a type, or null.
template <class T>
T* FindEarlier(const EffectContext& context) {
  if (context.earlier == nullptr) return nullptr;
  for (const std::unique_ptr<Effect>& effect : *context.earlier) {
    if (auto* found = dynamic_cast<T*>(effect.get())) return found;
  }
  return nullptr;
}

/// Role *setup*: change of an instrument's sections before it is cut into segments.
/// `torsional_ratio`: GJ / EI of the instrument.
using ShapeChange = void (*)(std::vector<WireSection>& sections, double torsional_ratio);

/// Role *setup*: change of the clearance between instruments by an effect. `instruments`: the
/// innermost first; `wall`: the vessel's wall. Throws UserError naming file, key, value and remedy.
using MakeRoom =
    std::function<void(const std::any& spec, const std::vector<Instrument>& instruments,
                       const WallModel& wall, Clearance& clearance)>;

/// One row of the table of effects.
struct EffectKind {
  std::string name;     ///< as in [effects.NAME]
  std::string summary;  ///< one line for people
  std::string roles;
  AnyKeys keys;
  std::string needs = {};  ///< another effect that must be named too; "" for none
  /// Makes the effect. Throws UserError naming file, key, value and remedy. Null for an effect that
  /// has only the role setup.
  std::function<std::unique_ptr<Effect>(const std::any& spec, const EffectContext& context)> make;
  ShapeChange shape = nullptr;
  MakeRoom room = nullptr;
};

/// Wraps a maker for an EffectKind with keys of type Keys<Spec>.
template <class Spec>
auto MakeWith(std::unique_ptr<Effect> (*make)(const Spec&, const EffectContext&)) {
  return [make](const std::any& spec, const EffectContext& context) {
    return make(std::any_cast<const Spec&>(spec), context);
  };
}

/// Table of all effects, in construction order: an effect comes after those that it needs.
const std::vector<EffectKind>& AllEffects();

/// Table of effects as text for the user.
std::string DescribeEffects();

}  // namespace torquer::effects
