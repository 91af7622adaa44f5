// The newest message of each topic that pages are shown. No I/O, no clock.
#pragma once

#include <chrono>
#include <map>
#include <memory>
#include <string>
#include <vector>

namespace torquer::viewer {

struct PageMessage {
  std::string content;
  bool text = false;
};
using SharedPageMessage = std::shared_ptr<const PageMessage>;

/// Topics of the program itself are always kept. Topics with names from other processes on the bus
/// are passing topics. At most kMostPassing of them are kept, and each is forgotten kPassingTime
/// after its last message. So passing topics can replace only each other.
class ShownTopics {
 public:
  using Time = std::chrono::steady_clock::time_point;
  static constexpr std::size_t kMostPassing = 16;
  static constexpr std::chrono::seconds kPassingTime{10};

  void Show(const std::string& topic, SharedPageMessage message);
  /// Shows a passing topic. If all places are taken, the topic that was shown longest ago is
  /// removed. Returns the removed topics.
  std::vector<std::string> ShowPassing(const std::string& topic, SharedPageMessage message,
                                       Time now);
  /// Forgets passing topics that are too old, and returns them.
  std::vector<std::string> Expire(Time now);
  void Forget(const std::string& topic);

  const std::map<std::string, SharedPageMessage>& newest() const { return newest_; }

 private:
  std::map<std::string, SharedPageMessage> newest_;
  std::map<std::string, Time> passing_;  // when each was shown
};

}  // namespace torquer::viewer
