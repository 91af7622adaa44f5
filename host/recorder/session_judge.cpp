#include "host/recorder/session_judge.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <map>
#include <optional>
#include <utility>

#include "host/api/row_run.h"
#include "host/recorder/course_feed.h"
#include "host/recorder/log_gaps.h"
#include "host/recorder/session_log.h"
#include "host/simulator/exchangeable_simulation.h"
#include "host/simulator/live_commands.h"
#include "host/support/angle.h"
#include "host/support/error.h"
#include "host/support/fnv1a.h"

namespace torquer {
namespace {

// Times in a log are not trusted: beyond these bounds it is not gradable.
constexpr std::int64_t kLatestUs = std::int64_t{1} << 52;
constexpr std::int64_t kLongestUs = std::int64_t{24} * 3600 * 1'000'000;

bool IsTime(std::int64_t time_us) { return time_us > 0 && time_us < kLatestUs; }

// First reading of a log: the simulator's clock, and the reasons why the commands alone do not
// decide the marks.
class SessionFrame {
 public:
  explicit SessionFrame(std::string content_hash) : content_hash_(std::move(content_hash)) {}

  void Read(const std::string& path) {
    SessionHandlers handlers;
    handlers.scene = [this](const auto& message) { Add(message); };
    handlers.state = [this](const auto& message) { Add(message); };
    handlers.command = [this](const auto& message) { Add(message); };
    handlers.devices = [this](const auto& message) { Add(message); };
    handlers.sample = [this](const auto& message) { gaps_.Add(message); };
    handlers.health = [this](const auto& message) { Add(message); };
    const SessionLogSummary summary = ReadSessionLog(path, handlers);
    if (summary.damage.any()) Refuse("the recording is damaged: " + summary.damage.Describe());
    if (summary.undecodable > 0) {
      Refuse(fmt::format("messages of the recording that cannot be read: {}", summary.undecodable));
    }
    Finish();
  }

  const std::string& reason() const { return reason_; }
  std::int64_t clock_id() const { return clock_id_; }
  // Start of the simulated time, rounded to the grid of the rows. A state is never published
  // exactly on time, and a few us must have no effect.
  std::int64_t start_us() const { return std::llround(start_us_) / kJudgeRowUs * kJudgeRowUs; }
  // Exchanges of instruments, which the simulator executed.
  const std::vector<simulator::DeviceExchange>& exchanges() const { return exchanges_; }
  // Time of the newest message of the simulator.
  std::int64_t end_us() const { return end_us_; }

 private:
  void Refuse(const std::string& reason) {
    if (reason_.empty()) reason_ = reason;
  }

  void Add(const torquer_lcm::scene_description_t& scene) {
    described_ = true;
    if (scene.content_hash == content_hash_) return;
    Refuse(
        fmt::format("it was recorded with other contents of the scene file ({}, now {}); give "
                    "that file by --scene",
                    scene.content_hash, content_hash_));
  }

  // Each message has all exchanges since the start.
  void Add(const torquer_lcm::devices_t& devices) {
    try {
      auto all = simulator::ReadExchanges(devices);
      if (all.size() > exchanges_.size()) exchanges_ = std::move(all);
    } catch (const UserError& error) {
      Refuse(error.what());
    }
  }

  void Add(const torquer_lcm::wire_state_t& state) {
    if (!(std::abs(state.time_s) <= Series::kMost) ||
        !(std::abs(state.solve_us) <= Series::kMost) || !IsTime(state.publish_us)) {
      return Refuse("a state has an impossible time");
    }
    if (!any_state_) AddFirst(state);
    if (state.clock_id != clock_id_) Refuse("the simulator's clock changed");
    if (state.tick < tick_) Refuse("the simulator was restarted during the recording");
    tick_ = std::max(tick_, state.tick);
    // A tick ends solve_us after its own time; a busy machine only publishes it later.
    start_us_ = std::min(
        start_us_, static_cast<double>(state.publish_us) - state.solve_us - 1e6 * state.time_s);
    end_us_ = std::max(end_us_, state.publish_us);
  }

  void AddFirst(const torquer_lcm::wire_state_t& state) {
    any_state_ = true;
    clock_id_ = state.clock_id;
    tick_ = state.tick;
    for (const torquer_lcm::instrument_state_t& instrument : state.instruments) {
      const auto first = first_sequence_.find(instrument.name);
      const bool recorded =
          first != first_sequence_.end() && first->second <= instrument.command_sequence;
      if (instrument.command_sequence >= 0 && !recorded) {
        Refuse("the recording began after the first commands; start it before the session");
      }
    }
  }

  void Add(const torquer_lcm::instrument_command_t& command) {
    gaps_.Add(command);
    first_sequence_.emplace(command.instrument, command.sequence);
    command_clock_id_ = command_clock_id_.value_or(command.clock_id);
    foreign_clock_ = foreign_clock_ || command.clock_id != *command_clock_id_;
    if (!IsTime(command.publish_us)) Refuse("a command has an impossible time");
  }

  void Add(const torquer_lcm::health_t& health) {
    gaps_.Add(health);
    if (health.process != "simulator") return;
    if (IsTime(health.publish_us)) end_us_ = std::max(end_us_, health.publish_us);
    for (std::size_t i = 0; i < health.names.size(); ++i) {
      if (health.names[i] != "refused_senders" || health.values[i] <= 0) continue;
      Refuse(
          "commands of a second sender were refused, and the recording does not name the senders");
    }
  }

  void Finish() {
    if (!described_ || !any_state_) return Refuse("the recording lacks the scene or its states");
    if (foreign_clock_ || command_clock_id_.value_or(clock_id_) != clock_id_) {
      Refuse("commands came from another machine, by another clock");
    }
    if (const std::int64_t missing = gaps_.missing_commands(); missing > 0) {
      Refuse(fmt::format("the recording lacks {} of the commands", missing));
    }
    if (!(start_us_ > -kLongestUs) || static_cast<double>(end_us_) - start_us_ > kLongestUs) {
      Refuse("the session is longer than a day");
    }
  }

  const std::string content_hash_;
  std::string reason_;
  LogGaps gaps_;
  std::map<std::string, std::int64_t> first_sequence_;  // by instrument
  std::optional<std::int64_t> command_clock_id_;
  bool foreign_clock_ = false;
  std::vector<simulator::DeviceExchange> exchanges_;
  bool described_ = false;
  bool any_state_ = false;
  std::int64_t clock_id_ = 0;
  std::int64_t tick_ = 0;
  double start_us_ = std::numeric_limits<double>::infinity();
  std::int64_t end_us_ = 0;
};

// Row of a script with the command that a live tick would get.
Command ToRow(const simulator::Command& live, double time_s) {
  Command row{.time_s = time_s,
              .hands = {},
              .lao_deg = kDegreesPerRad * live.controls.lao_rad,
              .cra_deg = kDegreesPerRad * live.controls.cra_rad,
              .xray = live.controls.xray,
              .contrast = live.controls.contrast};
  for (int k = 0; k < live.target.size(); ++k) {
    row.hands.push_back({live.target[k].insertion_mm, live.target[k].rotation_rad});
  }
  row.imaging = FromEffects(live.controls.imaging);
  row.table = FromEffects(live.controls.table);
  row.injector = FromEffects(live.controls.injector);
  return row;
}

// Second reading: the commands in rows that end at multiples of kJudgeRowUs by the log's clock.
class Repetition {
 public:
  Repetition(simulator::ExchangeableSimulation& simulation, const SessionFrame& frame)
      : frame_(frame),
        simulation_(simulation),
        commands_(simulation.scene_at_start()),
        run_(simulation.now()),
        row_(frame.start_us() / kJudgeRowUs),
        feed_(simulation, frame.clock_id()) {
    feed_.AddState(frame.start_us());
  }

  SessionJudgment Read(const std::string& path) {
    SessionHandlers handlers;
    handlers.command = [this](const torquer_lcm::instrument_command_t& message) {
      Take(message);
      if (IsWithin(message)) feed_.Add(message);
    };
    handlers.imaging = [this](const torquer_lcm::imaging_command_t& message) { Take(message); };
    handlers.wedges = [this](const torquer_lcm::wedge_command_t& message) { Take(message); };
    handlers.table = [this](const torquer_lcm::table_command_t& message) { Take(message); };
    handlers.injector = [this](const torquer_lcm::injector_command_t& message) { Take(message); };
    ReadSessionLog(path, handlers);
    RunTo(std::max(row_ + 1, frame_.end_us() / kJudgeRowUs));
    if (!problem_.empty()) return {.not_gradable = problem_, .course = {}};
    return {.not_gradable = "", .readings = feed_.readings(), .course = feed_.course()};
  }

 private:
  template <class Message>
  bool IsWithin(const Message& message) const {
    return message.publish_us >= frame_.start_us() && message.publish_us <= frame_.end_us();
  }

  // The simulator received no command before its start. A command that is logged late counts from
  // the next row on.
  template <class Message>
  void Take(const Message& message) {
    if (!IsWithin(message)) return;
    RunTo((message.publish_us - 1) / kJudgeRowUs);
    now_us_ = std::max(now_us_, message.publish_us);
    commands_.Take(message, bus::Sender{}, now_us_);
  }

  // Runs the rows up to number `last`. Rows at rest are longer, but find silent senders in time.
  void RunTo(std::int64_t last) {
    constexpr std::int64_t kRestRows = 4;
    while (row_ < last) {
      const std::int64_t next = commands_.fresh() ? row_ + 1 : std::min(last, row_ + kRestRows);
      const std::int64_t end_us = next * kJudgeRowUs;
      now_us_ = std::max(now_us_, end_us);
      commands_.Age(now_us_);
      run_.GoTo(ToRow(commands_.command(), 1e-6 * static_cast<double>(end_us - frame_.start_us())),
                {});
      commands_.Settle();
      row_ = next;
      feed_.AddState(end_us);
      Exchange(1e-6 * static_cast<double>(end_us - frame_.start_us()));
    }
  }

  // Repeats the exchanges up to a simulated time, at the end of the row.
  void Exchange(double time_s) {
    const std::vector<simulator::DeviceExchange>& all = frame_.exchanges();
    for (; exchanged_ < all.size() && all[exchanged_].time_s <= time_s; ++exchanged_) {
      try {
        simulation_.Repeat(all[exchanged_]);
      } catch (const UserError& error) {
        if (problem_.empty()) problem_ = error.what();
      }
      run_.ContinueIn(simulation_.now());
    }
  }

  const SessionFrame& frame_;
  simulator::ExchangeableSimulation& simulation_;
  std::size_t exchanged_ = 0;  // exchanges that were repeated
  std::string problem_;        // reason why one could not be repeated
  simulator::LiveCommands commands_;
  RowRun run_;
  std::int64_t row_;  // number of the newest row
  CourseFeed feed_;
  std::int64_t now_us_ = 0;
};

}  // namespace

SessionJudgment JudgeSession(scene::Scene& scene, const std::string& path) {
  simulator::ExchangeableSimulation simulation(scene);
  if (simulation.now().Readings().empty()) return {};
  SessionFrame frame(Hex(scene.content_hash()));
  frame.Read(path);
  if (!frame.reason().empty()) return {.not_gradable = frame.reason(), .course = {}};
  return Repetition(simulation, frame).Read(path);
}

void ApplyJudgment(const SessionJudgment& judgment, SessionReport& report) {
  report.not_gradable = judgment.not_gradable;
  if (!judgment.repeated()) return;
  report.judged = true;
  report.readings = judgment.readings;
  report.course = judgment.course;
}

}  // namespace torquer
