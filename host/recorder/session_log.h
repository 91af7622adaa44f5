// Reader of a recorded session, message by message.
#pragma once

#include <cstdint>
#include <functional>
#include <map>
#include <string>

#include "host/support/event_log.h"
#include "torquer_lcm/device_sample_t.hpp"
#include "torquer_lcm/devices_t.hpp"
#include "torquer_lcm/hand_motion_t.hpp"
#include "torquer_lcm/health_t.hpp"
#include "torquer_lcm/imaging_command_t.hpp"
#include "torquer_lcm/injector_command_t.hpp"
#include "torquer_lcm/instrument_command_t.hpp"
#include "torquer_lcm/readings_t.hpp"
#include "torquer_lcm/scene_description_t.hpp"
#include "torquer_lcm/table_command_t.hpp"
#include "torquer_lcm/wedge_command_t.hpp"
#include "torquer_lcm/wire_state_t.hpp"

namespace torquer {

/// Handlers for the messages of a session; an empty function skips its message type undecoded.
struct SessionHandlers {
  std::function<void(const torquer_lcm::device_sample_t&)> sample;
  std::function<void(const torquer_lcm::instrument_command_t&)> command;
  std::function<void(const torquer_lcm::imaging_command_t&)> imaging;
  std::function<void(const torquer_lcm::wedge_command_t&)> wedges;
  std::function<void(const torquer_lcm::table_command_t&)> table;
  std::function<void(const torquer_lcm::injector_command_t&)> injector;
  std::function<void(const torquer_lcm::wire_state_t&)> state;
  std::function<void(const torquer_lcm::scene_description_t&)> scene;
  std::function<void(const torquer_lcm::devices_t&)> devices;
  std::function<void(const torquer_lcm::readings_t&)> readings;
  std::function<void(const torquer_lcm::health_t&)> health;
  std::function<void(const torquer_lcm::hand_motion_t&)> truth;  ///< of the emulator
};

/// Summary of a log besides the messages passed to the handlers.
struct SessionLogSummary {
  std::int64_t messages = 0;     ///< all, those of other channels included
  std::int64_t undecodable = 0;  ///< on our channels, but not of the channel's type
  std::int64_t started_us = 0;   ///< time of the first record, by the logger's wall clock
  /// Counts by channel whose name begins with TORQUER but that is unknown; at most 20 channels.
  std::map<std::string, std::int64_t> unknown;
  LogDamage damage;  ///< unreadable parts of the log
};

/// Reads all intact records of the log at `path`, in recorded order. Memory use does not grow with
/// the log. Throws UserError if the file cannot be read, has no LCM message, or holds several logs.
SessionLogSummary ReadSessionLog(const std::string& path, const SessionHandlers& handlers);

}  // namespace torquer
