#include "host/viewer/health_topics.h"

#include <algorithm>
#include <utility>

namespace torquer::viewer {
namespace {

std::string HealthTopic(const std::string& process, const std::string& instrument) {
  return "health/" + process + "/" + instrument;
}

}  // namespace

std::vector<std::string> HealthTopics::Add(const torquer_lcm::scene_description_t& scene) {
  std::vector<std::string> before = std::exchange(instruments_, scene.instruments);
  if (instruments_.size() > kMostInstruments) instruments_.resize(kMostInstruments);
  std::vector<std::string> gone;
  for (const std::string& name : before) {
    if (!HasInstrument(name)) gone.push_back(HealthTopic("daemon", name));
  }
  return gone;
}

bool HealthTopics::Needs(const torquer_lcm::health_t& health) const {
  if (health.process == "daemon") return !instruments_.empty() && HasInstrument(health.instrument);
  return health.instrument.empty() &&
         (health.process == "simulator" || health.process == "emulator");
}

bool HealthTopics::HasInstrument(const std::string& name) const {
  return instruments_.empty() ||
         std::find(instruments_.begin(), instruments_.end(), name) != instruments_.end();
}

std::string HealthTopics::TopicOf(const torquer_lcm::health_t& health) {
  return HealthTopic(health.process, health.instrument);
}

}  // namespace torquer::viewer
