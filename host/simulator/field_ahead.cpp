#include "host/simulator/field_ahead.h"

#include <exception>

#include "host/support/error_output.h"
#include "host/support/realtime.h"

namespace torquer::simulator {

namespace {

constexpr double kStepMm = 3;  // distance of the tip or along a centerline between two requests

}  // namespace

void BuildAround(const vessel::Vessel& vessel, const Eigen::Vector3d& tip_mm) {
  if (vessel.bricks != nullptr) vessel.bricks->Prefetch(tip_mm, kBuiltAround_mm);
}

FieldAhead::FieldAhead(const vessel::Vessel& vessel)
    : vessel_(vessel), last_tip_mm_(Eigen::Vector3d::Constant(1e9)) {
  if (vessel.bricks != nullptr) {
    thread_ = std::jthread([this](const std::stop_token& stop) { RunUntilProblem(stop); });
  }
}

FieldAhead::~FieldAhead() = default;

void FieldAhead::Follow(const Eigen::Vector3d& tip_mm) {
  if (!thread_.joinable() || (tip_mm - last_tip_mm_).norm() < kStepMm) return;
  const std::unique_lock lock(mutex_, std::try_to_lock);
  if (!lock) return;
  last_tip_mm_ = tip_mm;
  tip_mm_ = tip_mm;
  tip_waits_ = true;
  moved_.notify_one();
}

bool FieldAhead::NextTip(const std::stop_token& stop, bool may_wait, Eigen::Vector3d& tip_mm) {
  std::unique_lock lock(mutex_);
  if (may_wait) moved_.wait(lock, stop, [this] { return tip_waits_; });
  if (!tip_waits_) return false;
  tip_mm = tip_mm_;
  tip_waits_ = false;
  return true;
}

void FieldAhead::RunUntilProblem(const std::stop_token& stop) {
  LeaveRealtime();  // building bricks takes longer than a tick
  try {
    Run(stop);
  } catch (const std::exception& error) {
    PrintError(
        "torquer-simulator: the field is no longer built ahead of the tip ({}); the "
        "session goes on, and ticks in new places take longer\n",
        error.what());
    gave_up_ = true;
  }
}

void FieldAhead::Run(const std::stop_token& stop) {
  const vessel::BrickField& field = *vessel_.bricks;
  Eigen::Vector3d tip_mm;
  // The next session takes the bricks of a surface from the cache.
  for (const vessel::Centerline& curve : vessel_.centerlines.curves()) {
    if (vessel_.surface == nullptr) break;
    for (double s = 0; s <= curve.length_mm() && !stop.stop_requested(); s += kStepMm) {
      while (NextTip(stop, false, tip_mm)) BuildAround(vessel_, tip_mm);
      const vessel::CenterlineSample at = curve.At(s);
      field.Prefetch(at.position_mm, at.radius_mm + 1);
    }
  }
  while (!stop.stop_requested()) {
    if (NextTip(stop, true, tip_mm)) BuildAround(vessel_, tip_mm);
  }
}

}  // namespace torquer::simulator
