#include "host/simulator/replay.h"

#include <fmt/format.h>

#include <algorithm>
#include <torquer_lcm/devices_t.hpp>
#include <torquer_lcm/health_t.hpp>
#include <torquer_lcm/scene_description_t.hpp>
#include <torquer_lcm/wire_state_t.hpp>
#include <utility>
#include <vector>

#include "host/bus/message_check.h"
#include "host/bus/state_outline.h"
#include "host/simulator/exchangeable_simulation.h"
#include "host/support/error.h"
#include "host/support/fnv1a.h"
#include "protocol/lcm_channels.h"

namespace torquer::simulator {

namespace {

// Status bits of the wire itself, without those of commands and time limits.
constexpr std::int32_t kRepeatedStatus =
    protocol::kWireConverged | protocol::kWireOutsideLumen | protocol::kWireSnapped;

// Repeats the states of a log, one after the other.
class Repeater {
 public:
  Repeater(scene::Scene& scene, std::string log)
      : scene_(scene), log_(std::move(log)), simulation_(scene) {}

  void Check(const torquer_lcm::scene_description_t& recorded) const {
    const std::string hash = Hex(scene_.content_hash());
    if (recorded.content_hash == hash) return;
    throw UserError(
        fmt::format("{}: was recorded with other contents of the scene {} than {} has ({}, now "
                    "{}); give the scene file of the recording",
                    log_, recorded.scene_file, scene_.path(), recorded.content_hash, hash));
  }

  // The simulator describes an exchange before the tick that follows it. Each message has all of
  // them.
  void Add(const torquer_lcm::devices_t& recorded) {
    std::vector<DeviceExchange> all = ReadExchanges(recorded);
    if (all.size() > exchanges_.size()) exchanges_ = std::move(all);
  }

  void Add(const torquer_lcm::wire_state_t& recorded) {
    if (recorded.instrument_count != scene_.stack().size()) {
      throw UserError(fmt::format("{}: the state of tick {} has {} instruments, and {} has {}",
                                  log_, recorded.tick, recorded.instrument_count, scene_.path(),
                                  scene_.stack().size()));
    }
    // In a thinned log only some states describe the ticks before them. After a gap the other
    // states wait for such a state.
    if (!waiting_.empty() && recorded.tick < waiting_.back().tick) RefuseGap(recorded);
    if (!Reaches(recorded)) {
      const bool may_wait = recorded.tick > expected_tick_ && recorded.past_count == 0 &&
                            waiting_.size() < static_cast<std::size_t>(kMostPastInMessage);
      if (!may_wait) RefuseGap(recorded);
      waiting_.push_back(recorded);
      return;
    }
    for (const torquer_lcm::wire_state_t& state : waiting_) {
      RepeatMissing(state.tick, recorded);
      Take(state);
    }
    waiting_.clear();
    RepeatMissing(recorded.tick, recorded);
    Take(recorded);
  }

  // Call it after the last state.
  void Finish() const {
    if (!waiting_.empty()) RefuseGap(waiting_.front());
  }

  void AddUndecodable() { ++result_.undecodable; }
  void End() { result_.ended = true; }
  const ReplayResult& result() const { return result_; }

 private:
  void Note(std::int64_t tick) {
    differs_ = true;
    ++result_.differing;
    if (result_.first_difference < 0) result_.first_difference = tick;
  }

  // At rest the simulator publishes its last state again.
  bool IsRepeated(const torquer_lcm::wire_state_t& recorded) const {
    return result_.states > 0 && recorded.tick == expected_tick_ - 1;
  }

  // True if this state's own past covers all missing states before it. Tick 0, the start, comes
  // from the scene and takes no work.
  bool Reaches(const torquer_lcm::wire_state_t& recorded) const {
    if (IsRepeated(recorded)) return true;
    return recorded.tick >= expected_tick_ &&
           recorded.tick - std::max<std::int64_t>(expected_tick_, 1) <= recorded.past_count;
  }

  [[noreturn]] void RefuseGap(const torquer_lcm::wire_state_t& recorded) const {
    throw UserError(
        fmt::format("{}: the state of tick {} is followed by that of tick {}; a replay needs the "
                    "states of one run of the simulator, with at most {} missing in a row; start "
                    "the recording before the simulator, and keep all parts of a log",
                    log_, expected_tick_ - 1, recorded.tick, kMostPastInMessage));
  }

  void Take(const torquer_lcm::wire_state_t& recorded) {
    if (IsRepeated(recorded)) {
      if (!differs_ && !IsWhereItWas(recorded)) Note(recorded.tick);
      return;
    }
    if (recorded.tick > 0) {
      InstrumentPoses target(scene_.stack().size());
      for (int k = 0; k < target.size(); ++k) {
        const auto& instrument = recorded.instruments[static_cast<std::size_t>(k)];
        target[k] = {instrument.commanded_insertion_mm, instrument.commanded_rotation_rad};
      }
      Repeat(recorded.time_s, target, recorded.work);
    }
    ++expected_tick_;
    ++result_.states;
    result_.outlines += bus::IsOutline(recorded) ? 1 : 0;
    differs_ = !IsWhereItWas(recorded);
    if (differs_) Note(recorded.tick);
  }

  // True if a recorded state equals the simulated one bit for bit. Fields that the simulation does
  // not know, such as times and senders' numbers, are copied from the record. Parts that the
  // recorder omitted are omitted here too.
  bool IsWhereItWas(const torquer_lcm::wire_state_t& recorded) {
    expected_ = recorded;
    simulation_.now().Describe(expected_);
    expected_.status = (expected_.status & kRepeatedStatus) | (recorded.status & ~kRepeatedStatus);
    if (bus::IsOutline(recorded)) bus::ReduceToOutline(expected_);
    if (recorded.past_count == 0) bus::DropPast(expected_);
    return Encode(expected_, expected_bytes_) == Encode(recorded, recorded_bytes_);
  }

  static const std::vector<std::uint8_t>& Encode(const torquer_lcm::wire_state_t& state,
                                                 std::vector<std::uint8_t>& bytes) {
    const int size = state.getEncodedSize();
    bytes.resize(static_cast<std::size_t>(size));
    state.encode(bytes.data(), 0, size);
    return bytes;
  }

  // Repeats the missing states before tick `end` from the past that a later state describes.
  void RepeatMissing(std::int64_t end, const torquer_lcm::wire_state_t& later) {
    for (; expected_tick_ < end; ++expected_tick_) {
      ++result_.missing;
      if (expected_tick_ == 0) continue;
      const auto past = static_cast<std::size_t>(later.tick - expected_tick_ - 1);
      InstrumentPoses target(scene_.stack().size());
      for (int k = 0; k < target.size(); ++k) {
        const auto at = static_cast<std::size_t>(k);
        target[k] = {later.past_insertion_mm[past][at], later.past_rotation_rad[past][at]};
      }
      Repeat(later.past_time_s[past], target, later.past_work[past]);
    }
  }

  void Repeat(double time_s, const InstrumentPoses& target, int work) {
    for (; repeated_ < exchanges_.size() && exchanges_[repeated_].tick < expected_tick_;
         ++repeated_) {
      simulation_.Repeat(exchanges_[repeated_]);
    }
    Command command;
    command.time_s = time_s;
    command.target = target;
    CountedBudget budget(work);
    simulation_.now().Tick(command, budget);
  }

  scene::Scene& scene_;
  const std::string log_;
  ExchangeableSimulation simulation_;
  ReplayResult result_;
  std::vector<DeviceExchange> exchanges_;
  std::size_t repeated_ = 0;  // exchanges
  std::int64_t expected_tick_ = 0;
  bool differs_ = false;  // the newest state differs
  std::vector<torquer_lcm::wire_state_t> waiting_;
  torquer_lcm::wire_state_t expected_;
  std::vector<std::uint8_t> expected_bytes_, recorded_bytes_;
};

// Feeds the messages of a log to `repeater` until `go_on` returns false.
void Read(EventLogReader& log, Repeater& repeater,
          const std::function<bool(const ReplayResult&)>& go_on) {
  torquer_lcm::scene_description_t description;
  torquer_lcm::devices_t devices;
  torquer_lcm::wire_state_t state;
  torquer_lcm::health_t health;
  for (LogRecord record; log.Next(record);) {
    const auto decode = [&record, &repeater](auto& message) {
      const bool whole = bus::DecodeMessage(record.data.data(), record.data.size(), message);
      if (!whole) repeater.AddUndecodable();
      return whole;
    };
    if (record.channel == protocol::kSceneChannel) {
      if (decode(description)) repeater.Check(description);
    } else if (record.channel == protocol::kDevicesChannel) {
      if (decode(devices)) repeater.Add(devices);
    } else if (record.channel == protocol::kWireStateChannel) {
      if (decode(state)) repeater.Add(state);
    } else if (record.channel == protocol::kHealthChannel) {
      if (decode(health) && health.process == "simulator" && health.state == "stopping") {
        repeater.End();
      }
    }
    if (go_on && !go_on(repeater.result())) return;
  }
  repeater.Finish();
}

}  // namespace

ReplayResult Replay(scene::Scene& scene, const std::string& log,
                    const std::function<bool(const ReplayResult&)>& go_on) {
  RequireOneLog(log);  // before the work of the first session
  EventLogReader reader(log);
  Repeater repeater(scene, log);
  try {
    Read(reader, repeater, go_on);
  } catch (const UserError& error) {
    if (!reader.damage().any()) throw;
    throw UserError(fmt::format("{}; the log is damaged up to there: {}", error.what(),
                                reader.damage().Describe()));
  }
  ReplayResult result = repeater.result();
  result.damage = reader.damage();
  if (result.states == 0) {
    throw UserError(log + ": holds no wire state (channel " +
                    std::string(protocol::kWireStateChannel) +
                    ") of this version of the messages; record a running simulator" +
                    (result.damage.any() ? "; the log is damaged: " + result.damage.Describe()
                                         : std::string()));
  }
  return result;
}

}  // namespace torquer::simulator
