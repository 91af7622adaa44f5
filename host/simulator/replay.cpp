#include "host/simulator/replay.h"

#include <algorithm>
#include <lcm/lcm-cpp.hpp>
#include <torquer_lcm/scene_description_t.hpp>
#include <torquer_lcm/wire_state_t.hpp>

#include "host/simulator/session.h"
#include "host/support/error.h"
#include "protocol/lcm_channels.h"

namespace torquer::simulator {

ReplayResult Replay(scene::Scene& scene, const std::string& log) {
  lcm::LogFile file(log, "r");
  if (!file.good()) throw UserError(log + ": cannot be read; give a log written by lcm-logger");
  char hash[17];
  std::snprintf(hash, sizeof hash, "%016llx",
                static_cast<unsigned long long>(scene.content_hash()));

  Session session(scene);
  ReplayResult result;
  std::int64_t expected_tick = 0;
  while (const lcm::LogEvent* event = file.readNextEvent()) {
    if (event->channel == protocol::kSceneChannel) {
      torquer_lcm::scene_description_t recorded;
      if (recorded.decode(event->data, 0, event->datalen) == event->datalen &&
          recorded.content_hash != hash) {
        throw UserError(log + ": was recorded with the scene " + recorded.scene_file +
                        " when it had other contents than " + scene.path() + " (" +
                        recorded.content_hash + ", now " + hash + "); give the scene as it was");
      }
      continue;
    }
    if (event->channel != protocol::kWireStateChannel) continue;
    torquer_lcm::wire_state_t recorded;
    if (recorded.decode(event->data, 0, event->datalen) != event->datalen ||
        recorded.instrument != protocol::kGuidewire) {
      continue;
    }
    // The start, tick 0, is the scene's and takes no work.
    const std::int64_t missing = recorded.tick - expected_tick;
    if (missing < 0 || recorded.tick - std::max<std::int64_t>(expected_tick, 1) >
                           static_cast<std::int64_t>(recorded.past_work.size())) {
      throw UserError(log + ": after the state of tick " + std::to_string(expected_tick - 1) +
                      " comes that of tick " + std::to_string(recorded.tick) +
                      "; a replay needs the states of one run of the simulator, and can make up "
                      "for " +
                      std::to_string(kMostPastInMessage) +
                      " missing in a row; start the recording before the simulator");
    }
    const auto repeat = [&session](double time_s, const HandTarget& target, int work) {
      Command command;
      command.time_s = time_s;
      command.target = target;
      CountedBudget budget(work);
      session.Tick(command, budget);
    };
    for (; expected_tick < recorded.tick; ++expected_tick) {
      ++result.missing;
      if (expected_tick == 0) continue;
      const auto k = static_cast<std::size_t>(recorded.tick - expected_tick - 1);
      repeat(recorded.past_time_s[k],
             {recorded.past_insertion_mm[k], recorded.past_rotation_rad[k],
              recorded.past_catheter_insertion_mm[k], recorded.past_catheter_rotation_rad[k]},
             recorded.past_work[k]);
    }
    if (recorded.tick > 0) {
      repeat(recorded.time_s,
             {recorded.commanded_insertion_mm, recorded.commanded_rotation_rad,
              recorded.commanded_catheter_insertion_mm, recorded.commanded_catheter_rotation_rad},
             recorded.work);
    }
    ++expected_tick;
    ++result.states;
    if (static_cast<std::int64_t>(session.state_hash()) != recorded.state_hash) {
      ++result.differing;
      if (result.first_difference < 0) result.first_difference = recorded.tick;
    }
  }
  if (result.states == 0) {
    throw UserError(log + ": holds no wire state (channel " +
                    std::string(protocol::kWireStateChannel) + "); record a running simulator");
  }
  return result;
}

}  // namespace torquer::simulator
