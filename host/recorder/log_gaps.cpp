#include "host/recorder/log_gaps.h"

#include <fmt/format.h>

#include <algorithm>

#include "host/bus/state_outline.h"
#include "host/support/printable_text.h"
#include "protocol/lcm_channels.h"

namespace torquer {
namespace {

// Timeouts: 1.5 times the period of each message.
constexpr double kLatestStatusUs = 1'500'000;
constexpr double kLatestReadingsUs = 150'000;
constexpr double kLatestTruthUs = 15'000;

// Saturating addition: a log may hold any number.
void Count(std::int64_t more, std::int64_t& sum) {
  if (__builtin_add_overflow(sum, more, &sum)) sum = INT64_MAX;
}

// Count of numbers strictly between `first` and `last`; 0 if `last` is not above `first`.
std::int64_t Between(std::int64_t first, std::int64_t last) {
  std::int64_t steps = 0;
  if (last <= first) return 0;
  return __builtin_sub_overflow(last, first, &steps) ? INT64_MAX : steps - 1;
}

// " of NAME"; "" for a name without visible text.
std::string Of(const std::string& name) {
  if (name.find_first_not_of(' ') == std::string::npos) return "";
  return " of " + Printable(name);
}

}  // namespace

void LogGaps::Add(const torquer_lcm::instrument_command_t& command) {
  Instrument& of = instruments_[command.instrument];
  if (of.awaits_sample && of.samples > 0) ++of.missing_samples;
  if (of.commands > 0) {
    const torquer_lcm::instrument_command_t& last = of.command;
    const bool again = command.sequence == last.sequence && command.publish_us == last.publish_us;
    const bool before = command.clock_id == last.clock_id && command.publish_us < last.publish_us;
    of.disordered_commands += again || before ? 1 : 0;
    Count(Between(last.sequence, command.sequence), of.missing_commands);
  }
  ++of.commands;
  of.command = command;
  // A held position, or one from a page, belongs to no sample.
  of.awaits_sample = (command.flags & protocol::kCommandNoDevice) == 0;
}

void LogGaps::Add(const torquer_lcm::device_sample_t& sample) {
  Instrument& of = instruments_[sample.instrument];
  const bool of_command = of.awaits_sample && of.command.origin_us == sample.origin_us;
  // The first sample may belong to a command sent before the log began.
  if (of.samples > 0) {
    const bool same_run = sample.boot_id == of.sample.boot_id && sample.device == of.sample.device;
    if (same_run && sample.report_number <= of.sample.report_number) {
      ++of.disordered_samples;
    } else if (!of_command) {
      ++of.missing_commands;
    }
  }
  if (of.samples == 0 && of.commands > 1) Count(of.commands - 1, of.missing_samples);
  ++of.samples;
  of.sample = sample;
  of.awaits_sample = false;
}

void LogGaps::Add(const torquer_lcm::wire_state_t& state) {
  if (states_ > 0 && state.clock_id == state_.clock_id) {
    const bool again = state.tick == state_.tick && state.publish_us == state_.publish_us;
    // A restarted simulator counts from zero again, but with a later publish time.
    const bool before = state.tick < state_.tick && state.publish_us <= state_.publish_us;
    // A thinned log repeats its last state at the end, with its shape.
    const bool owed = outline_ && !bus::IsOutline(state);
    disordered_states_ += (again && !owed) || before ? 1 : 0;
  }
  ++states_;
  state_.tick = state.tick;
  state_.publish_us = state.publish_us;
  state_.clock_id = state.clock_id;
  outline_ = bus::IsOutline(state);
  longest_solve_us_ = std::max(longest_solve_us_, state.solve_us);
}

void LogGaps::Add(const torquer_lcm::readings_t& readings) {
  AddRegular(protocol::kReadingsChannel, "the simulator", readings.publish_us,
             static_cast<double>(readings.publish_us), kLatestReadingsUs + longest_solve_us_);
  longest_solve_us_ = 0;
}

void LogGaps::Add(const torquer_lcm::hand_motion_t& truth) {
  AddRegular(protocol::kEmulatorTruthChannel, truth.device, truth.publish_us, 1e6 * truth.time_s,
             kLatestTruthUs);
}

// The simulator sends its scene after each status without a message, except after the last status.
void LogGaps::AddScene() {
  repeated_scenes_ += simulator_spoke_ && !awaits_scene_ ? 1 : 0;
  awaits_scene_ = false;
}

void LogGaps::Add(const torquer_lcm::health_t& health) {
  const std::string of_process = health.device + health.instrument;
  const bool both = !health.process.empty() && !of_process.empty();
  AddRegular(protocol::kHealthChannel, health.process + (both ? " " : "") + of_process,
             health.publish_us, static_cast<double>(health.publish_us), kLatestStatusUs);
  if (health.process == "simulator") {
    const bool stops = health.state == "stopping";
    missing_scenes_ += awaits_scene_ ? 1 : 0;
    awaits_scene_ = health.message.empty() && !stops;
    simulator_spoke_ = true;
  }
  if (health.process != "daemon") return;
  Instrument& of = instruments_[health.instrument];
  of.ended = health.state == "stopping";
  for (std::size_t i = 0; i < health.names.size(); ++i) {
    if (health.names[i] == "reports_received") of.received = health.values[i];
  }
}

void LogGaps::AddRegular(const std::string& channel, const std::string& sender,
                         std::int64_t publish_us, double time_us, double latest_us) {
  const auto [found, first] = senders_.try_emplace({channel, sender});
  Sender& of = found->second;
  if (!first) {
    of.silences += time_us - of.time_us > latest_us ? 1 : 0;
    of.disordered += publish_us <= of.publish_us ? 1 : 0;
  }
  of.publish_us = publish_us;
  of.time_us = time_us;
}

std::int64_t LogGaps::missing_commands() const {
  std::int64_t missing = 0;
  for (const auto& [name, of] : instruments_) Count(of.missing_commands, missing);
  return missing;
}

std::vector<std::string> LogGaps::DescribeSilences() const {
  std::vector<std::string> lines;
  for (const auto& [key, of] : senders_) {
    if (of.silences == 0) continue;
    lines.push_back(fmt::format("{} {}{} at {}: messages are missing, or came late", of.silences,
                                of.silences == 1 ? "pause" : "pauses", Of(key.second), key.first));
  }
  return lines;
}

std::vector<std::string> LogGaps::Describe() const {
  std::vector<std::string> lines;
  const auto say = [&lines](std::int64_t count, const std::string& what, const std::string& of) {
    if (count > 0) lines.push_back(fmt::format("{} {}{}", count, what, Of(of)));
  };
  for (const auto& [name, of] : instruments_) {
    // A log may end between the last command and its sample. A daemon that stops has sent both.
    const bool last = of.ended && of.awaits_sample && of.samples > 0;
    const bool none = of.samples == 0 && of.received > 0 && of.commands > 0;
    say(of.missing_samples + (last ? 1 : 0), "device samples missing", name);
    say(none ? of.received : 0, "reports received but no device sample", name);
    say(of.missing_commands, "commands missing", name);
    say(of.samples > 0 && of.commands == 0 ? of.samples : 0, "samples but no command", name);
    say(of.disordered_samples, "device samples twice or out of order", name);
    say(of.disordered_commands, "commands twice or out of order", name);
  }
  say(disordered_states_, "wire states twice or out of order", "");
  say(missing_scenes_, "scene descriptions missing", "");
  say(repeated_scenes_, "scene descriptions without the status before them", "");
  for (const auto& [key, of] : senders_) {
    say(of.disordered, "messages twice or out of order at " + key.first, key.second);
  }
  return lines;
}

}  // namespace torquer
