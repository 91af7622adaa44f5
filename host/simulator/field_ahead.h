// Builds a vessel's field ahead of the wire, so that no tick has to.
#pragma once

#include <Eigen/Core>
#include <atomic>
#include <condition_variable>
#include <mutex>
#include <thread>

#include "host/simulator/vessel/vessel.h"

namespace torquer::simulator {

/// A thread beside the real-time loop: first what lies around the tip, again whenever the tip has
/// moved, then along the centerlines, then it rests. Without a surface there is nothing to build
/// and no thread. The field's values are the same with and without it, so that the session goes on
/// without should the memory run out; standard error says so.
class FieldAhead {
 public:
  /// `vessel` must outlive this.
  explicit FieldAhead(const vessel::Vessel& vessel);
  FieldAhead(const FieldAhead&) = delete;
  FieldAhead& operator=(const FieldAhead&) = delete;
  ~FieldAhead();

  /// Whether the thread has ended before its time, for want of memory.
  bool gave_up() const { return gave_up_; }

  /// Where the tip is. Never waits.
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
  Eigen::Vector3d last_tip_mm_;  // of the calling thread
  std::jthread thread_;
};

}  // namespace torquer::simulator
