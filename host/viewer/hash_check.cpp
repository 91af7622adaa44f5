#include "host/viewer/hash_check.h"

#include <exception>

namespace torquer::viewer {

HashCheck::HashCheck(scene::Scene& scene, const std::string& log)
    : thread_([this, &scene, log] { Run(scene, log); }) {}

HashCheck::~HashCheck() {
  stop_ = true;
  thread_.join();
}

HashCheck::Finding HashCheck::Get() const {
  const std::lock_guard lock(mutex_);
  return finding_;
}

void HashCheck::Run(scene::Scene& scene, const std::string& log) {
  try {
    const auto result =
        simulator::Replay(scene, log, [this](const simulator::ReplayResult& so_far) {
          const std::lock_guard lock(mutex_);
          finding_.result = so_far;
          return !stop_;
        });
    const std::lock_guard lock(mutex_);
    finding_.result = result;
    finding_.done = !stop_;
  } catch (const std::exception& error) {
    const std::lock_guard lock(mutex_);
    finding_.error = error.what();
  }
}

}  // namespace torquer::viewer
