#include "host/bus/simulators_heard.h"

#include <fmt/format.h>

#include <algorithm>

#include "host/support/printable_text.h"

namespace torquer::bus {

void SimulatorsHeard::State(const Sender& sender, std::int64_t now_us) {
  if (heard_.size() >= kMost && !heard_.contains(sender)) {
    heard_.erase(std::min_element(heard_.begin(), heard_.end(), [](const auto& a, const auto& b) {
      return a.second.heard_us < b.second.heard_us;
    }));
  }
  heard_[sender].heard_us = now_us;
}

void SimulatorsHeard::Scene(const Sender& sender, const std::string& name) {
  const auto found = heard_.find(sender);
  if (found != heard_.end()) found->second.scene = Printable(name, 40);
}

std::string SimulatorsHeard::Conflict(std::int64_t now_us) const {
  std::string names;
  int present = 0;
  for (const auto& [sender, heard] : heard_) {
    if (now_us - heard.heard_us >= kOldUs) continue;
    ++present;
    names += fmt::format("{}{} from {}", names.empty() ? "" : " and ",
                         heard.scene.empty() ? "a scene" : heard.scene, Describe(sender));
  }
  return present < 2 ? ""
                     : fmt::format("{} simulators publish: {}; stop all but one", present, names);
}

}  // namespace torquer::bus
