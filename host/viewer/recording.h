// Index of the log of a recorded session, for access from any time.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "host/support/event_log.h"
#include "host/support/log_parts.h"

namespace torquer::viewer {

/// Messages stay in the file; memory is 24 bytes for each.
class Recording {
 public:
  /// Messages of one channel, or of one process that reports health. The newest message replaces
  /// all before it.
  struct Topic {
    std::string channel;
    std::string name;  ///< the channel, for health with process and instrument
    std::vector<std::int64_t> times_us;

    /// Number of messages up to a time; 0: none yet.
    std::size_t CountAt(std::int64_t at_us) const;

   private:
    friend class Recording;
    std::vector<std::int64_t> places_;
    std::vector<std::uint32_t> sizes_;
  };

  /// Reads the log at `path` once. Throws UserError naming it when it cannot be read, or holds no
  /// wire state.
  explicit Recording(const std::string& path);

  const std::vector<Topic>& topics() const { return topics_; }
  /// Wire states with a shape. As in all topics, the times do not decrease.
  const Topic& states() const;
  /// Time from the first record, at 0, to the last.
  std::int64_t length_us() const { return length_us_; }
  const LogDamage& damage() const { return damage_; }

  /// The bytes of message k of a topic. Throws UserError when the file cannot be read any more.
  std::vector<std::uint8_t> Read(const Topic& topic, std::size_t k) const;

 private:
  Topic* Find(const std::string& channel, const std::string& name, bool needed);

  LogInput file_;
  std::vector<Topic> topics_;
  std::int64_t length_us_ = 0;
  LogDamage damage_;
};

}  // namespace torquer::viewer
