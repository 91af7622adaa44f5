#include "host/viewer/recording.h"

#include <algorithm>
#include <array>
#include <string_view>
#include <torquer_lcm/health_t.hpp>
#include <torquer_lcm/scene_description_t.hpp>
#include <torquer_lcm/wire_state_t.hpp>

#include "host/bus/message_check.h"
#include "host/bus/state_outline.h"
#include "host/support/error.h"
#include "host/viewer/health_topics.h"
#include "protocol/lcm_channels.h"

namespace torquer::viewer {
namespace {

constexpr const char* kRemedy = "give the file that torquer-recorder wrote";
// Largest number of processes that report health, as on a page.
constexpr std::size_t kMostTopics = 60;

// If a log has fewer shapes than ticks, the page shows only the states with a shape.
bool HasNoShape(const LogRecord& record) {
  torquer_lcm::wire_state_t state;
  return bus::DecodeMessage(record.data.data(), record.data.size(), state) && bus::IsOutline(state);
}

}  // namespace

std::size_t Recording::Topic::CountAt(std::int64_t at_us) const {
  const auto after = std::upper_bound(times_us.begin(), times_us.end(), at_us);
  return static_cast<std::size_t>(after - times_us.begin());
}

Recording::Recording(const std::string& path) : file_(path, kRemedy) {
  constexpr std::array kChannels = {std::string_view(protocol::kWireStateChannel),
                                    std::string_view(protocol::kWireForcesChannel),
                                    std::string_view(protocol::kPictureChannel),
                                    std::string_view(protocol::kSceneChannel),
                                    std::string_view(protocol::kDevicesChannel),
                                    std::string_view(protocol::kReadingsChannel),
                                    std::string_view(protocol::kHealthChannel),
                                    std::string_view(protocol::kVitalSignsChannel),
                                    std::string_view(protocol::kLateralPictureChannel)};
  EventLogReader log(path);
  std::int64_t first_us = 0;
  bool begun = false;
  HealthTopics sessions;
  for (LogRecord record; log.Next(record);) {
    if (log.logs() > 1) continue;
    if (!begun) first_us = record.time_us;
    begun = true;
    // A wall clock may be set back. The order of the records stays.
    length_us_ = std::max(length_us_, ElapsedUs(first_us, record.time_us));
    if (std::find(kChannels.begin(), kChannels.end(), record.channel) == kChannels.end()) continue;
    if (record.channel == protocol::kWireStateChannel && HasNoShape(record)) continue;
    const std::string channel(record.channel);
    std::string name = channel;
    bool needed = true;
    if (channel == protocol::kHealthChannel) {
      torquer_lcm::health_t health;
      if (!bus::DecodeMessage(record.data.data(), record.data.size(), health)) continue;
      name = HealthTopics::TopicOf(health);
      needed = sessions.Needs(health);
    } else if (channel == protocol::kSceneChannel) {
      torquer_lcm::scene_description_t scene;
      if (!bus::DecodeMessage(record.data.data(), record.data.size(), scene)) continue;
      sessions.Add(scene);
    }
    Topic* const topic = Find(channel, name, needed);
    if (topic == nullptr) continue;
    topic->times_us.push_back(length_us_);
    topic->places_.push_back(record.data_at);
    topic->sizes_.push_back(static_cast<std::uint32_t>(record.data.size()));
  }
  log.RequireOneLog();
  damage_ = log.damage();
  if (states().times_us.empty()) {
    throw UserError(path + ": holds no wire state (channel " +
                    std::string(protocol::kWireStateChannel) + "); " + kRemedy);
  }
}

const Recording::Topic& Recording::states() const {
  static const Topic none;
  for (const Topic& topic : topics_) {
    if (topic.channel == protocol::kWireStateChannel) return topic;
  }
  return none;
}

std::vector<std::uint8_t> Recording::Read(const Topic& topic, std::size_t k) const {
  std::vector<std::uint8_t> bytes(topic.sizes_.at(k));
  if (file_.ReadAt(topic.places_.at(k), bytes.data(), bytes.size()) != bytes.size()) {
    throw UserError(file_.path() + ": has become shorter; " + kRemedy);
  }
  return bytes;
}

// Finds or makes a topic; null if there are too many. Half of the topics are reserved for those
// that a session needs.
Recording::Topic* Recording::Find(const std::string& channel, const std::string& name,
                                  bool needed) {
  for (Topic& topic : topics_) {
    if (topic.name == name) return &topic;
  }
  if (channel == protocol::kHealthChannel && topics_.size() >= (needed ? 2 : 1) * kMostTopics) {
    return nullptr;
  }
  topics_.emplace_back();
  topics_.back().channel = channel;
  topics_.back().name = name;
  return &topics_.back();
}

}  // namespace torquer::viewer
