#include "host/python/navigation_pool.h"

#include <algorithm>
#include <cstring>
#include <utility>

namespace torquer::python {

NavigationPool::NavigationPool(const Scene& scene, const NavigationTask& task, std::size_t count,
                               std::size_t threads, const NavigationBuffers& buffers)
    : buffers_(buffers) {
  while (environments_.size() < count) {
    environments_.push_back(std::make_shared<Navigation>(scene, task));
  }
  for (std::size_t k = 0; k < std::min(threads, count); ++k) {
    threads_.emplace_back([this] { Work(); });
  }
}

NavigationPool::~NavigationPool() {
  {
    const std::lock_guard lock(mutex_);
    ending_ = true;
  }
  jobs_change_.notify_all();
  for (std::thread& thread : threads_) thread.join();
}

void NavigationPool::RequireOwnProcess() const {
  if (!forked()) return;
  throw Error("these environments run in threads of the parent process; make them after the fork");
}

void NavigationPool::Add(Job job) {
  RequireOwnProcess();
  {
    const std::lock_guard lock(mutex_);
    jobs_.push_back(std::move(job));
    ++at_work_;
  }
  jobs_change_.notify_one();
}

void NavigationPool::Exchange(std::size_t index, std::shared_ptr<Navigation> next) {
  std::shared_ptr<Navigation>& environment = environments_.at(index);
  if (next->action_size() != environment->action_size() ||
      next->vector_size() != environment->vector_size()) {
    throw Error("the next scene has another number of instruments; give scenes with the same ones");
  }
  environment = std::move(next);
}

void NavigationPool::Reset(std::size_t index, NavigationStart start) {
  Add({.index = index, .start = std::move(start), .action = {}});
}

void NavigationPool::Step(std::size_t index, std::vector<double> action) {
  Add({.index = index, .start = {}, .action = std::move(action)});
}

void NavigationPool::Do(const Job& job) {
  Navigation& environment = *environments_[job.index];
  if (job.action.empty()) {
    environment.Reset(job.start);
  } else {
    environment.Step(job.action.data());
  }
  for (std::size_t k = 0; k < kFacts; ++k) {
    buffers_.facts[k * environments_.size() + job.index] = environment.facts()[k];
  }
  if (buffers_.vectors != nullptr) {
    environment.Observe(buffers_.vectors + job.index * environment.vector_size());
  }
  if (buffers_.pictures == nullptr) return;
  const Picture& picture = environment.TakePicture();
  std::memcpy(buffers_.pictures + job.index * buffers_.picture_bytes, picture.gray.data(),
              std::min(buffers_.picture_bytes, picture.gray.size()));
}

void NavigationPool::Work() {
  std::unique_lock lock(mutex_);
  for (;;) {
    jobs_change_.wait(lock, [this] { return ending_ || !jobs_.empty(); });
    if (ending_) return;
    const Job job = std::move(jobs_.front());
    jobs_.pop_front();
    lock.unlock();
    std::exception_ptr failure;
    try {
      Do(job);
    } catch (...) {
      failure = std::current_exception();
    }
    lock.lock();
    if (failure) failure_ = failure;
    finished_.push_back(job.index);
    finished_changes_.notify_all();
  }
}

std::vector<std::size_t> NavigationPool::Wait(std::size_t count) {
  for (;;) {
    if (auto indices = WaitFor(count, std::chrono::hours(1))) return *std::move(indices);
  }
}

std::optional<std::vector<std::size_t>> NavigationPool::WaitFor(std::size_t count,
                                                                std::chrono::milliseconds longest) {
  RequireOwnProcess();
  std::unique_lock lock(mutex_);
  const std::size_t wanted = std::min(count, at_work_);
  const auto enough = [&] { return finished_.size() >= wanted; };
  if (!finished_changes_.wait_for(lock, longest, enough)) return {};
  const auto end = finished_.begin() + static_cast<std::ptrdiff_t>(wanted);
  std::vector<std::size_t> indices(finished_.begin(), end);
  finished_.erase(finished_.begin(), end);
  at_work_ -= wanted;
  if (failure_) std::rethrow_exception(std::exchange(failure_, nullptr));
  return indices;
}

std::size_t NavigationPool::at_work() const {
  if (forked()) return 0;
  const std::lock_guard lock(mutex_);
  return at_work_;
}

}  // namespace torquer::python
