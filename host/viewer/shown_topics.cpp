#include "host/viewer/shown_topics.h"

#include <algorithm>
#include <utility>

namespace torquer::viewer {

void ShownTopics::Show(const std::string& topic, SharedPageMessage message) {
  passing_.erase(topic);
  newest_[topic] = std::move(message);
}

std::vector<std::string> ShownTopics::ShowPassing(const std::string& topic,
                                                  SharedPageMessage message, Time now) {
  std::vector<std::string> gone = Expire(now);
  if (passing_.size() >= kMostPassing && !passing_.contains(topic)) {
    gone.push_back(std::min_element(passing_.begin(), passing_.end(), [](auto& a, auto& b) {
                     return a.second < b.second;
                   })->first);
    Forget(gone.back());
  }
  passing_[topic] = now;
  newest_[topic] = std::move(message);
  return gone;
}

std::vector<std::string> ShownTopics::Expire(Time now) {
  std::vector<std::string> gone;
  for (const auto& [topic, shown] : passing_) {
    if (now - shown >= kPassingTime) gone.push_back(topic);
  }
  for (const std::string& topic : gone) Forget(topic);
  return gone;
}

void ShownTopics::Forget(const std::string& topic) {
  passing_.erase(topic);
  newest_.erase(topic);
}

}  // namespace torquer::viewer
