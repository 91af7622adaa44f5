#include <fmt/format.h>

#include <cstddef>
#include <utility>

#include "host/api/impl.h"

namespace torquer {

namespace {

// Derivative of an instrument's tip, which lies on a segment of the curve or at its end.
Eigen::Vector3d AtTip(const WireModel& instrument, const Curve& curve, double insertion_mm,
                      const std::vector<Eigen::Vector3d>& of_nodes) {
  const int count = NodesBefore(instrument, curve, insertion_mm);
  if (count == 0) return of_nodes.front();
  const auto before = static_cast<std::size_t>(count) - 1;
  if (before + 1 >= of_nodes.size()) return of_nodes.back();
  const Eigen::Vector3d tip_mm = PointAt(instrument, curve, insertion_mm);
  const Eigen::Vector3d& from_mm = curve.nodes()[before];
  const double fraction = (tip_mm - from_mm).norm() / (curve.nodes()[before + 1] - from_mm).norm();
  return of_nodes[before] + fraction * (of_nodes[before + 1] - of_nodes[before]);
}

}  // namespace

void Simulation::TrackSensitivities(const std::vector<std::string>& keys) {
  const auto hold = impl().usage.Change();
  if (impl_->exchanged()) {
    throw Error(impl_->scene.name() +
                ": derivatives are tracked from the start of the scene, and an instrument was "
                "exchanged since; call Restart first");
  }
  if (impl_->simulation->tick() != 0) {
    throw Error(fmt::format(
        "{}: derivatives are tracked from the start of the scene, and this simulation is at {:g} "
        "s; call Restart first",
        impl_->scene.name(), impl_->simulation->time_s()));
  }
  Guarded([&] { impl_->simulation->TrackSensitivities(keys); });
  impl_->Restart();
}

std::vector<Sensitivity> Simulation::sensitivities() const {
  const auto hold = impl().usage.Look();
  std::vector<Sensitivity> all;
  const simulator::SensitivityTracker* const tracker = impl_->simulation->sensitivities();
  if (tracker == nullptr) return all;
  const WireState& state = impl_->simulation->state();
  for (std::size_t k = 0; k < tracker->keys().size(); ++k) {
    Sensitivity& one = all.emplace_back();
    one.key = tracker->keys()[k];
    one.value = tracker->value(k);
    one.unknown = tracker->Unknown(k);
    if (!one.unknown.empty()) {
      const simulator::SensitivityTracker::Loss& loss = tracker->LossOf(k);
      one.unknown_since_s = loss.time_s;
      one.first_unknown = loss.reason.empty() ? one.unknown : loss.reason;
      continue;
    }
    const std::vector<Eigen::Vector3d>& of_nodes = tracker->nodes_mm(k);
    for (const Eigen::Vector3d& node : of_nodes) one.nodes_mm.push_back(ToPoint(node));
    for (int i = 0; i < state.poses().size(); ++i) {
      one.tips_mm.push_back(ToPoint(AtTip(impl_->lent->stack().instrument(i), state,
                                          state.poses()[i].insertion_mm, of_nodes)));
    }
    for (effects::Reading& reading : tracker->Readings(k)) {
      one.readings.push_back({std::move(reading.name), reading.value});
    }
  }
  return all;
}

}  // namespace torquer
