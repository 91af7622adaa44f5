// A scene, built: the vessel, the instruments and just the effects that its spec calls for.
#pragma once

#include <cstddef>
#include <cstdint>
#include <functional>
#include <memory>
#include <string>
#include <vector>

#include "host/simulator/core/newton/newton_relaxation.h"
#include "host/simulator/core/paper/paper_relaxation.h"
#include "host/simulator/core/relaxation.h"
#include "host/simulator/core/stack/instrument_stack.h"
#include "host/simulator/core/wire_mechanics.h"
#include "host/simulator/core/wire_model.h"
#include "host/simulator/core/wire_state.h"
#include "host/simulator/effects/effect.h"
#include "host/simulator/scene/scene_spec.h"
#include "host/simulator/vessel/moving_field.h"
#include "host/simulator/vessel/patient_axes.h"
#include "host/simulator/vessel/vessel.h"

namespace torquer::scene {

/// Immovable: its parts refer to each other.
class Scene {
 public:
  /// Opens what the spec names and builds everything. Throws UserError naming file, line, key,
  /// value and remedy.
  explicit Scene(SceneSpec spec);
  /// The same of a file.
  explicit Scene(const std::string& path) : Scene(ReadScene(path)) {}
  /// Another scene of the same spec in the same vessel, whose field both build and use: for several
  /// simulations of one scene, also in threads beside each other.
  std::unique_ptr<Scene> MakeTwin() const;
  Scene(const Scene&) = delete;
  Scene& operator=(const Scene&) = delete;

  const SceneSpec& spec() const { return spec_; }
  const std::string& path() const { return spec_.path; }
  const std::string& name() const { return spec_.name; }
  const vessel::Vessel& vessel() const { return vessel_; }
  const vessel::PatientAxes& axes() const { return axes_; }
  const InstrumentStack& stack() const { return *stack_; }
  /// What the instruments are together.
  const WireModel& rod() const { return stack_->rod(); }
  /// The innermost first.
  const std::vector<effects::Instrument>& instruments() const { return instruments_; }
  /// The innermost instrument cut otherwise, for comparisons. Throws std::invalid_argument as
  /// WireModel does.
  std::unique_ptr<WireModel> MakeWire(double segment_mm, BendingLaw law) const;
  const WallModel& wall() const { return wall_; }
  Method method() const { return spec_.relaxation.method; }
  double budget_us() const { return spec_.relaxation.budget_us; }  ///< of a tick in real time
  int budget_units() const { return budget_units_; }               ///< of a tick of a script
  std::vector<std::string> effect_names() const;
  /// In the order in which they were made; one for every name but those that only shape the wire.
  const std::vector<std::unique_ptr<effects::Effect>>& effects() const { return effects_; }
  /// Their names.
  const std::vector<std::string>& names_of_effects() const { return names_of_effects_; }
  /// The vessel as it moves; null where it does not.
  vessel::MovingField* moving_field() { return moving_.get(); }
  /// FNV-1a of the spec as WriteScene writes it, and of the bytes that were parsed of the files
  /// that it names.
  std::uint64_t content_hash() const { return content_hash_; }

  /// A relaxation with this scene's method, wall and effects. One at a time: effects remember.
  std::unique_ptr<Relaxation> MakeRelaxation();
  /// The same with what `stand_in` gives for the energy term of each effect, by its number in
  /// effects().
  using StandIn = std::function<EnergyTerm*(std::size_t effect, EnergyTerm* term)>;
  std::unique_ptr<Relaxation> MakeRelaxation(const StandIn& stand_in);
  /// Where the instruments are at the start.
  InstrumentPlaces start() const;
  /// The wire at the start: nothing inserted, or laid along the path and relaxed.
  WireState MakeStart(Relaxation& relaxation) const;

 private:
  struct Twin {
    const Scene& of;
  };
  explicit Scene(Twin twin);

  void Build();
  WireModel MakeInstrument(const InstrumentSpec& spec, double segment_mm, BendingLaw law) const;
  void MakeAxes();
  void MakeEntry();
  void MakeStack();
  void CheckFit() const;
  void SetRelaxation();
  void MakeEffect(const EffectSpec& spec);
  void HashContent();

  SceneSpec spec_;
  vessel::Vessel vessel_;
  vessel::PatientAxes axes_;
  Sheath sheath_;
  std::vector<Eigen::Vector3d> start_path_mm_;
  std::unique_ptr<InstrumentStack> stack_;
  std::vector<effects::Instrument> instruments_;
  WallModel wall_;
  NewtonSettings newton_;
  PaperSettings paper_;
  int budget_units_ = 0;
  std::vector<std::unique_ptr<effects::Effect>> effects_;
  std::vector<std::string> names_of_effects_;
  std::vector<EnergyTerm*>
      terms_;  // of the relaxation that was made last, which looks them up here
  std::unique_ptr<vessel::MovingField> moving_;
  std::uint64_t content_hash_ = 0;
};

}  // namespace torquer::scene
