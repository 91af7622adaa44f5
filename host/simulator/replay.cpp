#include "host/simulator/replay.h"

#include <fmt/format.h>

#include <algorithm>
#include <lcm/lcm-cpp.hpp>
#include <torquer_lcm/scene_description_t.hpp>
#include <torquer_lcm/wire_state_t.hpp>

#include "host/simulator/simulation.h"
#include "host/support/error.h"
#include "host/support/fnv1a.h"
#include "protocol/lcm_channels.h"

namespace torquer::simulator {

namespace {

// Repeats the states of a log, one after the other.
class Repeater {
 public:
  Repeater(scene::Scene& scene, std::string log)
      : scene_(scene), log_(std::move(log)), simulation_(scene) {}

  void Check(const torquer_lcm::scene_description_t& recorded) const {
    const std::string hash = Hex(scene_.content_hash());
    if (recorded.content_hash == hash) return;
    throw UserError(fmt::format(
        "{}: was recorded with other contents of the scene {} than {} has ({}, now {}); give the "
        "scene as it was",
        log_, recorded.scene_file, scene_.path(), recorded.content_hash, hash));
  }

  void Add(const torquer_lcm::wire_state_t& recorded) {
    if (recorded.instrument_count != scene_.stack().size()) {
      throw UserError(fmt::format("{}: the state of tick {} has {} instruments, and {} has {}",
                                  log_, recorded.tick, recorded.instrument_count, scene_.path(),
                                  scene_.stack().size()));
    }
    // At rest the simulator publishes its last state again.
    if (result_.states > 0 && recorded.tick == expected_tick_ - 1) return;
    RepeatMissing(recorded);
    if (recorded.tick > 0) {
      InstrumentPlaces target(scene_.stack().size());
      for (int k = 0; k < target.size(); ++k) {
        const auto& instrument = recorded.instruments[static_cast<std::size_t>(k)];
        target[k] = {instrument.commanded_insertion_mm, instrument.commanded_rotation_rad};
      }
      Repeat(recorded.time_s, target, recorded.work);
    }
    ++expected_tick_;
    ++result_.states;
    if (static_cast<std::int64_t>(simulation_.state_hash()) == recorded.state_hash) return;
    ++result_.differing;
    if (result_.first_difference < 0) result_.first_difference = recorded.tick;
  }

  const ReplayResult& result() const { return result_; }

 private:
  // What was not recorded, from what this state says of the ticks before it. The start, tick 0, is
  // the scene's and takes no work.
  void RepeatMissing(const torquer_lcm::wire_state_t& recorded) {
    if (recorded.tick < expected_tick_ ||
        recorded.tick - std::max<std::int64_t>(expected_tick_, 1) > recorded.past_count) {
      throw UserError(fmt::format(
          "{}: after the state of tick {} comes that of tick {}; a replay needs the states of one "
          "run of the simulator, and can make up for {} missing in a row; start the recording "
          "before the simulator",
          log_, expected_tick_ - 1, recorded.tick, kMostPastInMessage));
    }
    for (; expected_tick_ < recorded.tick; ++expected_tick_) {
      ++result_.missing;
      if (expected_tick_ == 0) continue;
      const auto past = static_cast<std::size_t>(recorded.tick - expected_tick_ - 1);
      InstrumentPlaces target(scene_.stack().size());
      for (int k = 0; k < target.size(); ++k) {
        const auto at = static_cast<std::size_t>(k);
        target[k] = {recorded.past_insertion_mm[past][at], recorded.past_rotation_rad[past][at]};
      }
      Repeat(recorded.past_time_s[past], target, recorded.past_work[past]);
    }
  }

  void Repeat(double time_s, const InstrumentPlaces& target, int work) {
    Command command;
    command.time_s = time_s;
    command.target = target;
    CountedBudget budget(work);
    simulation_.Tick(command, budget);
  }

  scene::Scene& scene_;
  const std::string log_;
  Simulation simulation_;
  ReplayResult result_;
  std::int64_t expected_tick_ = 0;
};

template <class Message>
bool Decode(const lcm::LogEvent& event, Message& message) {
  return message.decode(event.data, 0, event.datalen) == event.datalen;
}

}  // namespace

ReplayResult Replay(scene::Scene& scene, const std::string& log) {
  lcm::LogFile file(log, "r");
  if (!file.good()) throw UserError(log + ": cannot be read; give a log written by lcm-logger");
  Repeater repeater(scene, log);
  while (const lcm::LogEvent* event = file.readNextEvent()) {
    torquer_lcm::scene_description_t description;
    torquer_lcm::wire_state_t state;
    if (event->channel == protocol::kSceneChannel && Decode(*event, description)) {
      repeater.Check(description);
    } else if (event->channel == protocol::kWireStateChannel && Decode(*event, state)) {
      repeater.Add(state);
    }
  }
  if (repeater.result().states == 0) {
    throw UserError(log + ": holds no wire state (channel " +
                    std::string(protocol::kWireStateChannel) +
                    ") of this version of the messages; record a running simulator");
  }
  return repeater.result();
}

}  // namespace torquer::simulator
