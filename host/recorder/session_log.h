// Reads a recorded session, message by message.
#pragma once

#include <cstdint>
#include <functional>
#include <map>
#include <string>

#include "host/support/event_log.h"
#include "torquer_lcm/device_sample_t.hpp"
#include "torquer_lcm/hand_motion_t.hpp"
#include "torquer_lcm/health_t.hpp"
#include "torquer_lcm/instrument_command_t.hpp"
#include "torquer_lcm/readings_t.hpp"
#include "torquer_lcm/scene_description_t.hpp"
#include "torquer_lcm/wire_state_t.hpp"

namespace torquer {

/// What to do with each message of a session; an empty function skips its kind undecoded.
struct SessionHandlers {
  std::function<void(const torquer_lcm::device_sample_t&)> sample;
  std::function<void(const torquer_lcm::instrument_command_t&)> command;
  std::function<void(const torquer_lcm::wire_state_t&)> state;
  std::function<void(const torquer_lcm::scene_description_t&)> scene;
  std::function<void(const torquer_lcm::readings_t&)> readings;
  std::function<void(const torquer_lcm::health_t&)> health;
  std::function<void(const torquer_lcm::hand_motion_t&)> truth;  ///< of the emulator
};

/// What a log held besides what was handed on.
struct SessionLogSummary {
  std::int64_t messages = 0;     ///< all, those of other channels included
  std::int64_t undecodable = 0;  ///< on our channels, but not of the channel's type
  std::int64_t started_us = 0;   ///< time of the first record, by the logger's wall clock
  /// Messages by channel whose name begins as ours do, but is none of ours; 20 channels at most.
  std::map<std::string, std::int64_t> unknown;
  LogDamage damage;  ///< what could not be read
};

/// Reads all whole records of the log at `path`, in recorded order, in memory that does not
/// grow with the log. Throws UserError when the file cannot be read or holds no LCM message.
SessionLogSummary ReadSessionLog(const std::string& path, const SessionHandlers& handlers);

}  // namespace torquer
