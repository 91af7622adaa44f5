// Scene in memory: the vessel, the instruments, and only the effects that its spec names.
#pragma once

#include <cstddef>
#include <cstdint>
#include <functional>
#include <memory>
#include <string>
#include <vector>

#include "host/simulator/core/newton/newton_relaxation.h"
#include "host/simulator/core/newton/shadow_wire.h"
#include "host/simulator/core/paper/paper_relaxation.h"
#include "host/simulator/core/relaxation.h"
#include "host/simulator/core/stack/instrument_stack.h"
#include "host/simulator/core/wire_mechanics.h"
#include "host/simulator/core/wire_model.h"
#include "host/simulator/core/wire_state.h"
#include "host/simulator/effects/effect.h"
#include "host/simulator/scene/entry.h"
#include "host/simulator/scene/scene_spec.h"
#include "host/simulator/vessel/moving_field.h"
#include "host/simulator/vessel/patient_axes.h"
#include "host/simulator/vessel/vessel.h"

namespace torquer::scene {

/// Not movable, because its parts refer to each other.
class Scene {
 public:
  /// Opens the files that the spec names and builds all parts. Throws UserError naming file, line,
  /// key, value and remedy.
  explicit Scene(SceneSpec spec);
  /// Reads the spec with ReadScene(path) first.
  explicit Scene(const std::string& path) : Scene(ReadScene(path)) {}
  /// Builds a scene of `spec`. It shares the vessel and the field of `other` if their vessels have
  /// equal keys; stiffness may differ. Otherwise it opens the files, as above.
  Scene(SceneSpec spec, const Scene& other);
  /// Builds another scene of the same spec, which shares this scene's vessel and field. Both may be
  /// simulated at the same time in different threads.
  std::unique_ptr<Scene> MakeTwin() const;
  /// Builds the scene with a device of the library as an instrument; see scene::WithDevice. It
  /// shares this scene's vessel and field. Throws UserError naming instrument, device and remedy.
  std::unique_ptr<Scene> WithDevice(int instrument, const std::string& device) const;
  Scene(const Scene&) = delete;
  Scene& operator=(const Scene&) = delete;

  const SceneSpec& spec() const { return spec_; }
  const std::string& path() const { return spec_.path; }
  const std::string& name() const { return spec_.name; }
  const vessel::Vessel& vessel() const { return vessel_; }
  /// Saves the vessel's built field for the next run (MeshVessel::SaveCache). Returns the reason of
  /// a failure, otherwise an empty text. For a vessel without a surface it has no effect.
  std::string KeepField() const;
  const vessel::PatientAxes& axes() const { return axes_; }
  const InstrumentStack& stack() const { return *stack_; }
  /// All instruments, the innermost first.
  const std::vector<effects::Instrument>& instruments() const { return instruments_; }
  /// The innermost instrument with another segment length and bending law, for comparisons. Throws
  /// std::invalid_argument as WireModel does.
  std::unique_ptr<WireModel> MakeWire(double segment_mm, BendingLaw law) const;
  const WallModel& wall() const { return wall_; }
  Method method() const { return spec_.relaxation.method; }
  double budget_us() const { return spec_.relaxation.budget_us; }  ///< of a live tick
  int budget_units() const { return budget_units_; }               ///< of a script's tick
  /// Longest tick of a script, s, while the vessel moves or an effect evolves.
  double longest_tick_s() const { return 1e-3 * spec_.relaxation.longest_tick_ms; }
  std::vector<std::string> effect_names() const;
  /// Effects in the order of construction, without those that only shape the wire.
  const std::vector<std::unique_ptr<effects::Effect>>& effects() const { return effects_; }
  /// Names of effects(), in the same order.
  const std::vector<std::string>& names_of_effects() const { return names_of_effects_; }
  /// Field of the moving vessel; null if the vessel does not move.
  vessel::MovingField* moving_field() { return moving_.get(); }
  /// FNV-1a of the spec as WriteScene writes it, without [case]. It includes the devices' values,
  /// and the bytes of the files that the vessel and the effects have read.
  std::uint64_t content_hash() const { return content_hash_; }

  /// Makes a relaxation with this scene's method, wall and effects. Use one at a time, because
  /// effects have state.
  std::unique_ptr<Relaxation> MakeRelaxation();
  /// The energy term of each effect is replaced by the result of `stand_in`. `effect` is an index
  /// into effects().
  using StandIn = std::function<EnergyTerm*(std::size_t effect, EnergyTerm* term)>;
  std::unique_ptr<Relaxation> MakeRelaxation(const StandIn& stand_in);
  /// Makes a shadow of a wire in this scene, which must outlive it. Use one at a time, because
  /// effects have state.
  std::unique_ptr<ShadowWire> MakeShadow();
  /// Places of the instruments at the start.
  InstrumentPoses start() const;
  /// Wire at the start: without insertion, or laid along the start path and relaxed. `converged`:
  /// true if that succeeded; may be null.
  WireState MakeStart(Relaxation& relaxation, bool* converged = nullptr) const;

 private:
  struct Twin {
    const Scene& of;
  };
  explicit Scene(Twin twin);

  // Builds all but the vessel, which is that of `sharing` if it is not null.
  void Build(const Scene* sharing);
  WireModel MakeInstrument(const InstrumentSpec& spec, double segment_mm, BendingLaw law) const;
  void MakeAxes();
  void MakeEntries();
  void CheckFit(const EntrySpec& spec, const Entry& entry, double radius_mm) const;
  void CheckApart(const InstrumentSpec& beside) const;
  void MakeStack();
  void LayBeside(Clearance& clearance) const;
  void SetRelaxation();
  // The vessel as the wire feels it now.
  const ClearanceField& WireField() const;
  // Effect with a name; null for none.
  const effects::Effect* FindEffect(const std::string& name) const;
  void MakeEffect(const EffectSpec& spec, const Scene* sharing);
  void HashFiles();
  void HashContent();

  SceneSpec spec_;
  vessel::Vessel vessel_;
  vessel::PatientAxes axes_;
  Entry entry_;
  Entry own_entry_;  // of the instrument that has one
  std::unique_ptr<InstrumentStack> stack_;
  std::vector<effects::Instrument> instruments_;
  WallModel wall_;
  NewtonSettings newton_;
  PaperSettings paper_;
  int budget_units_ = 0;
  std::vector<std::unique_ptr<effects::Effect>> effects_;
  std::vector<std::string> names_of_effects_;
  std::vector<EnergyTerm*> terms_;  // of the newest relaxation, which refers to this list
  std::unique_ptr<vessel::MovingField> moving_;
  std::string files_hash_;  // of the vessel's files; "" without any
  std::uint64_t content_hash_ = 0;
};

}  // namespace torquer::scene
