// What every effect offers: the roles through which it takes part.
//
// An effect is one file pair and one line in registry.cpp. It exists only in scenes that name it;
// the relaxation knows roles, never effects.
#pragma once

#include <Eigen/Core>
#include <Eigen/Geometry>
#include <any>
#include <array>
#include <cstdint>
#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "host/simulator/core/energy_term.h"
#include "host/simulator/core/instrument_place.h"
#include "host/simulator/core/internal_forces.h"
#include "host/simulator/core/relaxation.h"
#include "host/simulator/core/stack/hand_forces.h"
#include "host/simulator/core/stack/instrument_stack.h"
#include "host/simulator/core/wire_mechanics.h"
#include "host/simulator/core/wire_model.h"
#include "host/simulator/core/wire_state.h"
#include "host/simulator/vessel/centerline.h"
#include "host/simulator/vessel/moving_field.h"
#include "host/simulator/vessel/patient_axes.h"
#include "host/support/key_table.h"

namespace torquer::effects {

class Effect;

/// What effects may know of an instrument besides its mechanics.
struct Instrument {
  std::string name;
  const WireModel* model = nullptr;
  double inner_radius_mm = 0;                       ///< of its lumen; 0: solid
  std::optional<double> friction_coefficient = {};  ///< on the wall; none: the friction effect's
  double coating_mm = 0;                            ///< length of the coated end
  double coating_coefficient = 0;                   ///< of friction, there
  double linear_density_g_m = 0;                    ///< less that of the blood it displaces
  double attenuation_1_mm = 0.8;                    ///< of X-rays, by its material
  double marker_mm = 0;                             ///< length of its opaque distal part
  double marker_1_mm = 0;                           ///< attenuation there
};

/// The index of the instrument with a name. Refuses `key` of a table where there is none.
int FindInstrument(const std::vector<Instrument>& instruments, const std::string& name,
                   const TableSpec& spec, const std::string& key);

/// What effects may look at while they are made. All outlive the effect. What a bench without a
/// scene lacks is null or empty.
struct EffectContext {
  const WireModel& wire;  ///< the rod that the instruments are together
  const WallModel& wall;
  const ClearanceField* field = nullptr;  ///< the vessel at rest
  const vessel::CenterlineNetwork* centerlines = nullptr;
  Eigen::AlignedBox3d bounds_mm = {};  ///< of the vessel
  vessel::PatientAxes axes = {};
  const std::vector<std::unique_ptr<Effect>>* earlier = nullptr;  ///< made before this one
  const vessel::MovingField* moving = nullptr;  ///< the vessel as it moves; null where it does not
  std::vector<Instrument> instruments = {};     ///< the innermost first
  const InstrumentStack* stack = nullptr;       ///< of them

  /// The index of the instrument with a name. Refuses `key` of a table where there is none.
  int FindInstrument(const std::string& name, const TableSpec& spec, const std::string& key) const {
    return effects::FindInstrument(instruments, name, spec, key);
  }
  /// A unit direction of the vessel's frame.
  Eigen::Vector3d Direction(const DirectionSpec& spec) const;
};

/// What the operator has chosen on the X-ray system, besides where the C-arm stands.
struct Imaging {
  enum class Mode : std::uint8_t { kAsScene, kPlain, kSubtraction, kRoadmap };
  static constexpr double kLeastPulses = 1, kMostPulses = 60;
  static constexpr double kMostMagnification = 4;
  static constexpr double kMostShutter = 0.45;

  Mode mode = Mode::kAsScene;
  double pulses_per_s = 0;   ///< kLeastPulses to kMostPulses; 0: as the scene has it
  double magnification = 1;  ///< 1 to kMostMagnification: how many times narrower the field is
  /// Share of the picture that each shutter covers, 0 to kMostShutter.
  double left = 0, right = 0, top = 0, bottom = 0;
  bool operator==(const Imaging&) const = default;
};

/// What the hand does besides moving the instruments.
struct Controls {
  double lao_rad = 0;  ///< C-arm, positive LAO
  double cra_rad = 0;  ///< C-arm, positive CRA
  bool xray = false;   ///< pedal down
  bool contrast = false;
  Imaging imaging{};
};

/// A tick after its relaxation, for the roles that go on from there.
struct TickView {
  double time_s = 0;  ///< simulated, since the start
  double step_s = 0;  ///< since the tick before; 0 at the start
  const Controls& controls;
  const InstrumentPlaces& target;
  const WireState& state;
  const Expansion& expansion;
  const TickReport& report;
};

/// A number that an effect has found, for people and records.
struct Reading {
  std::string name;  ///< with its unit at the end, as in force_tip_mN
  double value = 0;
};

/// Role *timed*: knows how long the tick takes that is about to be relaxed.
class Timed {
 public:
  virtual ~Timed() = default;
  /// `step_s`: simulated since the tick before, >= 0.
  virtual void Lapse(double step_s) = 0;
};

/// Role *evolution*: its own state, carried on once a tick.
class Evolution {
 public:
  virtual ~Evolution() = default;
  virtual void Advance(const TickView& tick) = 0;
};

/// Role *observer*: reads the relaxed state, changes nothing.
class Observer {
 public:
  virtual ~Observer() = default;
  virtual void Observe(const TickView& tick) = 0;
  /// What it has found so far.
  virtual std::vector<Reading> Readings() const = 0;
  /// What it has found along the wire in the last tick; null where it looks for nothing there.
  virtual const InternalForces* AlongWire() const { return nullptr; }
  /// At the hand of each instrument, the innermost first; null where AlongWire is.
  virtual const std::array<HandForce, kMostInstruments>* AtHands() const { return nullptr; }
};

/// Role *image*: makes pictures, in its own thread where there is one.
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
  /// On the thread of the ticks: takes what the next picture shows. Cheap; false where none is due.
  virtual bool Take(const TickView& tick) = 0;
  /// On any one thread: the picture of what was taken last.
  virtual void Render(Picture& out) = 0;
};

class Effect {
 public:
  Effect() = default;
  Effect(const Effect&) = delete;
  Effect& operator=(const Effect&) = delete;
  virtual ~Effect() = default;

  /// The roles that it takes; null for all others.
  virtual EnergyTerm* energy_term() { return nullptr; }
  virtual const WallStiffness* wall_stiffness() { return nullptr; }
  virtual vessel::FieldMotion* motion() { return nullptr; }
  virtual Timed* timed() { return nullptr; }
  virtual Evolution* evolution() { return nullptr; }
  virtual Observer* observer() { return nullptr; }
  virtual ImageSource* image() { return nullptr; }

  /// Forgets everything, as at the start. Energy terms have their own Reset.
  virtual void Restart() {}
  /// Remembers what `twin`, the same effect of the same scene, remembers. Neither is in a tick, and
  /// no picture of either is being rendered.
  virtual void CopyFrom(const Effect& twin) { static_cast<void>(twin); }
};

/// The effect of a type that was made before, or null.
template <class T>
T* FindEarlier(const EffectContext& context) {
  if (context.earlier == nullptr) return nullptr;
  for (const std::unique_ptr<Effect>& effect : *context.earlier) {
    if (auto* found = dynamic_cast<T*>(effect.get())) return found;
  }
  return nullptr;
}

/// Role *stage*: what an effect makes of an instrument's sections, before it is cut into segments.
/// `torsional_ratio`: GJ / EI of the instrument.
using ShapeChange = void (*)(std::vector<WireSection>& sections, double torsional_ratio);

/// Role *stage* of several instruments: the room that an effect gives them. `instruments`: the
/// innermost first; `wall`: the vessel's. Throws UserError naming file, key, value and remedy.
using MakeRoom = std::function<Clearance(
    const std::any& spec, const std::vector<Instrument>& instruments, const WallModel& wall)>;

/// One row of the table of effects.
struct EffectKind {
  std::string name;     ///< as in [effects.NAME]
  std::string summary;  ///< one line for people
  std::string roles;
  AnyKeys keys;
  std::string needs = {};  ///< the effect that must be named too; "" for none
  /// Makes the effect. Throws UserError naming file, key, value and remedy. Null where the effect
  /// is nothing but a stage.
  std::function<std::unique_ptr<Effect>(const std::any& spec, const EffectContext& context)> make;
  ShapeChange shape = nullptr;
  MakeRoom room = nullptr;
};

/// The function of an EffectKind for keys of type Keys<Spec>.
template <class Spec>
auto MakeWith(std::unique_ptr<Effect> (*make)(const Spec&, const EffectContext&)) {
  return [make](const std::any& spec, const EffectContext& context) {
    return make(std::any_cast<const Spec&>(spec), context);
  };
}

/// All effects there are, in the order in which they are made: what needs another comes after it.
const std::vector<EffectKind>& AllEffects();

/// The table of effects for people, as text.
std::string DescribeEffects();

}  // namespace torquer::effects
