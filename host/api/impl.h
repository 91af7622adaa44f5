// Private data of the public classes of torquer.h.
//
// torquer.h stands alone, and the simulator lies below it. So some types have a twin there:
//   Scene, Simulation: scene::Scene and simulator::Simulation, hidden from the ABI
//   Command: simulator::Command, in rad, without heap, with the doubts of a live hand
//   StepReport: TickReport, which the solver fills for one tick
//   Hand, InstrumentInfo: InstrumentPose and effects::Instrument, with which mechanics calculates
//   Imaging, Reading, Picture: those of effects, which read the first and fill the others
//   Forces: InternalForces, in N and mJ
//   Surface: vessel::SurfaceMesh, without the removed parts
#pragma once

#include <Eigen/Core>
#include <atomic>
#include <cstddef>
#include <memory>
#include <string>
#include <vector>

#include "host/api/past.h"
#include "host/api/row_run.h"
#include "host/api/torquer/torquer.h"
#include "host/simulator/scene/scene.h"
#include "host/simulator/simulation.h"
#include "host/support/error.h"
#include "host/support/usage.h"

namespace torquer {

inline Point ToPoint(const Eigen::Vector3d& x) { return {x[0], x[1], x[2]}; }

struct Scene::Impl {
  /// `keeps`: the last copy keeps the vessel's field for the next program.
  explicit Impl(std::unique_ptr<scene::Scene> made, bool keeps = true);
  ~Impl();
  Impl(const Impl&) = delete;
  Impl& operator=(const Impl&) = delete;

  /// Returns a scene for one simulation only, because effects have state. It is this scene, or a
  /// twin if another simulation uses this one. These parts must outlive it.
  std::shared_ptr<scene::Scene> Lend() const;

  const std::unique_ptr<scene::Scene> scene;
  mutable std::atomic<bool> lent = false;
  const bool keeps_field;
  const std::string folder;
  std::vector<InstrumentInfo> instruments;
};

struct Simulation::Impl {
  explicit Impl(const Scene& of);
  Impl(const Impl& other);
  /// Returns to the start of the scene.
  void Restart();
  /// True if an instrument was exchanged since the start.
  bool exchanged() const { return scene.impl_ != scene_at_start.impl_; }
  /// Continues in another scene, with a simulation in its state or at its start.
  /// References to `scene` and the command stay valid.
  void ContinueIn(const Scene& next, std::shared_ptr<scene::Scene> next_lent,
                  std::unique_ptr<simulator::Simulation> next_simulation);

  Scene scene_at_start;
  Scene scene;
  std::shared_ptr<scene::Scene> lent;
  std::unique_ptr<simulator::Simulation> simulation;
  RowRun rows;
  Past past;
  std::vector<Picture> pictures;   ///< of each plane
  std::vector<bool> pictures_due;  ///< a picture was taken that `pictures` does not have
  mutable Usage<Error> usage;
};

/// Throws Error if the scene has no instrument of that number.
void CheckInstrument(std::size_t instrument, const Scene& scene);

/// Calls `call`, and converts its UserError to Error.
template <class Call>
auto Guarded(Call call) -> decltype(call()) {
  try {
    return call();
  } catch (const UserError& error) {
    throw Error(error.what());
  }
}

}  // namespace torquer
