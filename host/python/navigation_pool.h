// Environments that step in parallel threads, and write into memory that numpy reads.
#pragma once

#include <unistd.h>

#include <chrono>
#include <condition_variable>
#include <cstddef>
#include <cstdint>
#include <deque>
#include <exception>
#include <memory>
#include <mutex>
#include <optional>
#include <thread>
#include <vector>

#include "host/python/navigation.h"

namespace torquer::python {

/// Output of the environments: one row for each.
struct NavigationBuffers {
  float* vectors = nullptr;          ///< null: not observed
  std::uint8_t* pictures = nullptr;  ///< null: not observed
  std::size_t picture_bytes = 0;
  double* facts = nullptr;  ///< kFacts rows with one value for each environment
};

/// Only the process that made it has its threads: calls of a forked child are refused.
class NavigationPool {
 public:
  /// `count` and `threads` > 0. The buffers must outlive this.
  NavigationPool(const Scene& scene, const NavigationTask& task, std::size_t count,
                 std::size_t threads, const NavigationBuffers& buffers);
  ~NavigationPool();
  NavigationPool(const NavigationPool&) = delete;
  NavigationPool& operator=(const NavigationPool&) = delete;

  std::size_t count() const { return environments_.size(); }
  std::size_t action_size() const { return environments_.front()->action_size(); }

  /// An environment, which must not be at work.
  const std::shared_ptr<Navigation>& environment(std::size_t index) {
    return environments_.at(index);
  }
  /// Replaces an environment, which must not be at work, by one with another scene. The next call
  /// for it is a Reset. Its actions, vectors and pictures must have the sizes of the others.
  void Exchange(std::size_t index, std::shared_ptr<Navigation> next);
  /// Throws in a forked child.
  void RequireOwnProcess() const;
  /// Starts the reset of an environment, which must not be at work.
  void Reset(std::size_t index, NavigationStart start);
  /// Starts a step of an environment, which must not be at work.
  void Step(std::size_t index, std::vector<double> action);
  /// Waits until `count` environments at work, or all of them, have finished. Returns them in the
  /// order of finishing. If environments failed, throws the exception of one of them.
  std::vector<std::size_t> Wait(std::size_t count);
  /// Same as Wait, but returns no environment after `longest`.
  std::optional<std::vector<std::size_t>> WaitFor(std::size_t count,
                                                  std::chrono::milliseconds longest);
  /// Throws for arguments that Reset and Step refuse, before any environment begins.
  static void CheckStart(const NavigationStart& start) { Navigation::CheckStart(start); }
  void CheckAction(const double* action) const { environments_.front()->CheckAction(action); }
  /// True in a forked child of the process that has the threads.
  bool forked() const { return getpid() != process_; }
  /// Number of environments at work, or finished and not yet returned.
  std::size_t at_work() const;

 private:
  struct Job {
    std::size_t index = 0;
    NavigationStart start;
    std::vector<double> action;  // empty: a reset
  };

  void Add(Job job);
  void Work();
  void Do(const Job& job);

  const pid_t process_ = getpid();
  const NavigationBuffers buffers_;
  std::vector<std::shared_ptr<Navigation>> environments_;
  mutable std::mutex mutex_;
  std::condition_variable jobs_change_;
  std::condition_variable finished_changes_;
  std::deque<Job> jobs_;
  std::deque<std::size_t> finished_;
  std::size_t at_work_ = 0;
  std::exception_ptr failure_;
  bool ending_ = false;
  std::vector<std::thread> threads_;
};

/// Deletes a pool, except in a forked child, which does not have its threads.
struct NavigationPoolEnd {
  void operator()(NavigationPool* pool) const {
    if (!pool->forked()) delete pool;
  }
};

}  // namespace torquer::python
