// Builds a vessel's field ahead of the wire, so that ticks need not build it.
#pragma once

#include <Eigen/Core>
#include <atomic>
#include <condition_variable>
#include <mutex>
#include <thread>

#include "host/simulator/vessel/vessel.h"

namespace torquer::simulator {

/// Builds all bricks of the vessel that a tip within kBuiltAround_mm of this place can need.
void BuildAround(const vessel::Vessel& vessel, const Eigen::Vector3d& tip_mm);
constexpr double kBuiltAround_mm = 12;

/// Thread beside the real-time loop. It builds the field around the tip, again whenever the tip has
/// moved. Between these it follows the centerlines of a surface. A vessel without bricks needs no
/// thread. The field's values are the same with and without it. If the memory runs out, the thread
/// ends with a message on standard error, and the session goes on.
class FieldAhead {
 public:
  /// `vessel` must outlive this.
  explicit FieldAhead(const vessel::Vessel& vessel);
  FieldAhead(const FieldAhead&) = delete;
  FieldAhead& operator=(const FieldAhead&) = delete;
  ~FieldAhead();

  /// True if the thread ended early because of an error, usually lack of memory.
  bool gave_up() const { return gave_up_; }

  /// Sets the position of the tip. Never waits. Call it from one thread only.
  void Follow(const Eigen::Vector3d& tip_mm);

 private:
  void RunUntilProblem(const std::stop_token& stop);
  void Run(const std::stop_token& stop);
  bool NextTip(const std::stop_token& stop, bool may_wait, Eigen::Vector3d& tip_mm);

  const vessel::Vessel& vessel_;
  std::mutex mutex_;
  std::condition_variable_any moved_;
  Eigen::Vector3d tip_mm_;
  bool tip_waits_ = false;
  std::atomic<bool> gave_up_ = false;
  Eigen::Vector3d last_tip_mm_;  // used only by the thread that calls Follow
  std::jthread thread_;
};

}  // namespace torquer::simulator
