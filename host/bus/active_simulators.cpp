#include "host/bus/active_simulators.h"

#include <fmt/format.h>

#include <algorithm>

#include "host/support/printable_text.h"

namespace torquer::bus {

void ActiveSimulators::State(const Sender& sender, std::int64_t now_us) {
  if (publishers_.size() >= kMost && !publishers_.contains(sender)) {
    publishers_.erase(std::min_element(
        publishers_.begin(), publishers_.end(),
        [](const auto& a, const auto& b) { return a.second.heard_us < b.second.heard_us; }));
  }
  publishers_[sender].heard_us = now_us;
}

void ActiveSimulators::Scene(const Sender& sender, const std::string& name) {
  const auto found = publishers_.find(sender);
  if (found != publishers_.end()) found->second.scene = Printable(name, 40);
}

std::string ActiveSimulators::Conflict(std::int64_t now_us) const {
  std::string names;
  int present = 0;
  for (const auto& [sender, publisher] : publishers_) {
    if (now_us - publisher.heard_us >= kOldUs) continue;
    ++present;
    names += fmt::format("{}{} from {}", names.empty() ? "" : " and ",
                         publisher.scene.empty() ? "a scene" : publisher.scene, Describe(sender));
  }
  return present < 2 ? ""
                     : fmt::format("{} simulators publish: {}; stop all but one", present, names);
}

}  // namespace torquer::bus
