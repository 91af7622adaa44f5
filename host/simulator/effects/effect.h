// What every effect offers: the roles through which it takes part.
//
// An effect is one file pair and one line in registry.cpp. It exists only in scenes that name it;
// the relaxation knows roles, never effects.
#pragma once

#include <Eigen/Core>
#include <Eigen/Geometry>
#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "host/simulator/core/coaxial/coaxial_pair.h"
#include "host/simulator/core/energy_term.h"
#include "host/simulator/core/relaxation.h"
#include "host/simulator/core/wire_mechanics.h"
#include "host/simulator/core/wire_model.h"
#include "host/simulator/core/wire_state.h"
#include "host/simulator/vessel/centerline.h"
#include "host/simulator/vessel/moving_field.h"
#include "host/simulator/vessel/patient_axes.h"
#include "host/support/strict_toml.h"

namespace torquer::effects {

class Effect;

/// What effects may look at while they are made. All outlive the effect. What a bench without a
/// scene lacks is null.
struct EffectContext {
  const WireModel& wire;
  const WallModel& wall;
  const ClearanceField* field = nullptr;  ///< the vessel at rest
  const vessel::CenterlineNetwork* centerlines = nullptr;
  Eigen::AlignedBox3d bounds_mm = {};  ///< of the vessel
  vessel::PatientAxes axes = {};
  const std::vector<std::unique_ptr<Effect>>* earlier = nullptr;  ///< made before this one
  const vessel::MovingField* moving = nullptr;  ///< the vessel as it moves; null where it does not
  /// Wire and catheter, of which `wire` is the rod that they are together; null without catheter.
  const CoaxialPair* coaxial = nullptr;
  double catheter_inner_mm = 0;  ///< radius of its lumen
};

/// What the hand does besides moving the wire.
struct Controls {
  double lao_rad = 0;  ///< C-arm, positive LAO
  double cra_rad = 0;  ///< C-arm, positive CRA
  bool xray = false;   ///< pedal down
  bool contrast = false;
};

/// A tick after its relaxation, for the roles that go on from there.
struct TickView {
  double time_s = 0;  ///< simulated, since the start
  double step_s = 0;  ///< since the tick before; 0 at the start
  const Controls& controls;
  const HandTarget& target;
  const WireState& state;
  const Expansion& expansion;
  const TickReport& report;
};

/// A number that an effect has found, for people and records.
struct Reading {
  std::string name;  ///< with its unit at the end, as in force_tip_mN
  double value = 0;
};

/// Role *evolution*: a state of its own, carried on once a tick.
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
};

/// Role *image*: makes pictures, in a thread of its own where there is one.
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
  virtual Evolution* evolution() { return nullptr; }
  virtual Observer* observer() { return nullptr; }
  virtual ImageSource* image() { return nullptr; }

  /// Forgets everything, as at the start. Energy terms have a Reset of their own.
  virtual void Restart() {}
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

/// One key of an effect's table, as it is read and as it is documented.
struct Key {
  const char* name;
  const char* unit;  ///< "" for none
  double lowest;
  double highest;
  std::optional<double> fallback;  ///< none: it must be given
  const char* meaning;

  double Read(StrictTable& keys) const;
};

/// A key that is no number, for the documentation.
struct OtherKey {
  const char* name;
  const char* form;  ///< "text", "list of points" ..
  const char* meaning;
};

/// Changes the sections of a wire.
using ShapeChange = std::function<void(std::vector<WireSection>&)>;

/// A catheter before it is cut into segments.
struct CatheterParts {
  std::vector<WireSection> sections;
  double tip_mm = 0;
  double max_length_mm = 0;
  double inserted_at_start_mm = 0;
  double inner_radius_mm = 0;
};

/// One row of the table of effects.
struct EffectKind {
  const char* name;     ///< as in [effects.NAME]
  const char* summary;  ///< one line for people
  const char* roles;
  std::vector<Key> keys;
  std::vector<OtherKey> other_keys;
  const char* needs;          ///< the effect that must be named too; "" for none
  const char* excludes = "";  ///< the effect that must not be named too; "" for none
  /// Reads the effect's keys. Throws UserError naming file, key, value and remedy. Null where the
  /// effect is nothing but the wire's sections.
  std::unique_ptr<Effect> (*make)(StrictTable& keys, const EffectContext& context);
  /// Role *shape*: the wire from a table, instead of what [wire] says; null for all others.
  std::vector<WireSection> (*sections)(StrictTable& keys) = nullptr;
  /// Role *shape*: changes the wire's sections, wherever they are from; null for all others.
  ShapeChange (*shape)(StrictTable& keys) = nullptr;
  /// Role *instrument*: a second one around the wire; null for all others.
  CatheterParts (*catheter)(StrictTable& keys, double segment_mm) = nullptr;
};

/// All effects there are, in the order in which they are made.
const std::vector<EffectKind>& AllEffects();

/// The row with a name; throws UserError naming the nearest known one.
const EffectKind& FindEffect(const std::string& name, const std::string& where);

/// The table of effects and keys for people; as Markdown for the documentation.
std::string DescribeEffects(bool markdown);

}  // namespace torquer::effects
