#include "host/recorder/session_report.h"

#include <Eigen/LU>
#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>

#include "host/bus/state_outline.h"
#include "host/support/error.h"
#include "protocol/hid_reports.h"
#include "protocol/lcm_channels.h"

namespace torquer {
namespace {

constexpr char kStopping[] = "stopping";      // last state that a daemon reports
constexpr std::size_t kMostRecent = 100'000;  // samples not yet shown by a state: minutes

// Saturating arithmetic, because numbers in a log may have any value.
std::int64_t Sum(std::int64_t a, std::int64_t b) {
  std::int64_t sum = 0;
  if (!__builtin_add_overflow(a, b, &sum)) return sum;
  using Limits = std::numeric_limits<std::int64_t>;
  return b > 0 ? Limits::max() : Limits::min();
}
std::int64_t Difference(std::int64_t a, std::int64_t b) {
  std::int64_t difference = 0;
  if (!__builtin_sub_overflow(a, b, &difference)) return difference;
  using Limits = std::numeric_limits<std::int64_t>;
  return b < 0 ? Limits::max() : Limits::min();
}

// Position of an instrument, mm and rad, with its carried remainder.
Eigen::Vector2d PositionOf(const torquer_lcm::wire_state_t& state, std::size_t index) {
  const torquer_lcm::instrument_state_t& instrument = state.instruments[index];
  return {ArcLengthMm(state, index) + instrument.carried_mm,
          instrument.rotation_rad + instrument.carried_rad};
}

constexpr std::int8_t kDoubtfulSample = protocol::kFlagLift | protocol::kFlagSensorFault;
constexpr std::int32_t kDoubtfulCommand = protocol::kCommandLift | protocol::kCommandSensorFault;

}  // namespace

Distribution Distribute(std::vector<double>& values) {
  Distribution result;
  if (values.empty()) return result;
  std::sort(values.begin(), values.end());
  const auto rank = [&values](double fraction) {
    const auto position = std::ceil(fraction * static_cast<double>(values.size()));
    return values[static_cast<std::size_t>(std::max(position, 1.0)) - 1];
  };
  result.count = static_cast<std::int64_t>(values.size());
  result.p50 = rank(0.50);
  result.p99 = rank(0.99);
  result.p999 = rank(0.999);
  result.max = values.back();
  return result;
}

double ArcLengthMm(const torquer_lcm::wire_state_t& state, std::size_t instrument) {
  // Locates the published tip on the polyline. The insertion field only repeats the command, so it
  // is not evidence.
  const Eigen::Vector3d tip(state.instruments[instrument].tip_mm);
  const auto& own_nodes_mm = state.instruments[instrument].nodes_mm;
  const auto& nodes_mm = own_nodes_mm.empty() ? state.nodes_mm : own_nodes_mm;
  double length_mm = 0;
  double nearest_mm = std::numeric_limits<double>::infinity();
  double tip_length_mm = 0;
  for (std::size_t i = 1; i < nodes_mm.size(); ++i) {
    const Eigen::Vector3d from = Eigen::Vector3f(nodes_mm[i - 1].data()).cast<double>();
    const Eigen::Vector3d to = Eigen::Vector3f(nodes_mm[i].data()).cast<double>();
    const Eigen::Vector3d along = to - from;
    const double square = along.squaredNorm();
    const double t = square > 0 ? std::clamp((tip - from).dot(along) / square, 0.0, 1.0) : 0;
    const double away_mm = (from + t * along - tip).norm();
    if (away_mm <= nearest_mm) {
      nearest_mm = away_mm;
      tip_length_mm = length_mm + t * std::sqrt(square);
    }
    length_mm += std::sqrt(square);
  }
  return tip_length_mm;
}

bool SessionReport::Has(const std::string& effect) const {
  return std::find(description.effects.begin(), description.effects.end(), effect) !=
         description.effects.end();
}

bool SessionReport::Good() const {
  for (const InstrumentReport& instrument : instruments) {
    if (instrument.driven() && !instrument.Good()) return false;
  }
  return undecodable == 0 && gaps.empty() && unknown.empty() && !damage.any();
}

SessionHandlers SessionReporter::Handlers() {
  SessionHandlers handlers;
  handlers.sample = [this](const torquer_lcm::device_sample_t& message) { Add(message); };
  handlers.command = [this](const torquer_lcm::instrument_command_t& message) { Add(message); };
  handlers.state = [this](const torquer_lcm::wire_state_t& message) { Add(message); };
  handlers.scene = [this](const torquer_lcm::scene_description_t& message) {
    scene_ = message;
    gaps_.AddScene();
  };
  handlers.readings = [this](const torquer_lcm::readings_t& message) { Add(message); };
  handlers.devices = [this](const torquer_lcm::devices_t& message) { Add(message); };
  handlers.health = [this](const torquer_lcm::health_t& message) { Add(message); };
  handlers.truth = [this](const torquer_lcm::hand_motion_t& message) { Add(message); };
  return handlers;
}

// The sample has the clutch and the sensor's own flags. Only the command has the daemon's finding
// that the surface is poor. It comes just before its sample.
bool SessionReporter::Held(const Channel& channel, const torquer_lcm::device_sample_t& sample) {
  const bool doubted = channel.command_origin_us == sample.origin_us && channel.command_doubtful;
  return (sample.buttons & protocol::kButtonClutch) != 0 || (sample.flags & kDoubtfulSample) != 0 ||
         doubted;
}

void SessionReporter::Add(const torquer_lcm::device_sample_t& sample) {
  gaps_.Add(sample);
  Channel& channel = channels_[sample.instrument];
  InstrumentReport& report = channel.report;
  ++report.samples;
  const bool held = Held(channel, sample);
  if (!channel.first_sample) channel.first_sample = sample;
  if (channel.last_sample) {
    // Motion of the hand during a device restart is unknown.
    const bool reset = sample.boot_id != channel.last_sample->boot_id;
    channel.report.resets += reset ? 1 : 0;
    const std::int64_t axial =
        reset ? 0 : Difference(sample.axial_counts, channel.last_sample->axial_counts);
    const std::int64_t transverse =
        reset ? 0 : Difference(sample.transverse_counts, channel.last_sample->transverse_counts);
    report.axial.sensor_counts = Sum(report.axial.sensor_counts, axial);
    report.rotation.sensor_counts = Sum(report.rotation.sensor_counts, transverse);
    // Motion between two samples counts as held if either sample was held.
    if (held || channel.last_held) {
      report.axial.held_counts = Sum(report.axial.held_counts, axial);
      report.rotation.held_counts = Sum(report.rotation.held_counts, transverse);
    }
  }
  channel.last_held = held;
  channel.last_sample = sample;
  if (channel.recent.size() == kMostRecent) channel.recent.pop_front();
  channel.recent.push_back({sample.origin_us, report.axial, report.rotation});
}

// A state shows the motion up to the sample with the same origin time.
void SessionReporter::Show(Channel& channel, std::int64_t origin_us) {
  while (!channel.recent.empty() && channel.recent.front().origin_us <= origin_us) {
    channel.shown = channel.recent.front();
    channel.recent.pop_front();
  }
}

void SessionReporter::Add(const torquer_lcm::instrument_command_t& command) {
  gaps_.Add(command);
  Channel& channel = channels_[command.instrument];
  ++channel.report.commands;
  channel.command_clock_id = command.clock_id;
  channel.command_origin_us = command.origin_us;
  channel.command_doubtful = (command.flags & kDoubtfulCommand) != 0;
  course_.Add(command);
}

void SessionReporter::Add(const torquer_lcm::wire_state_t& state) {
  gaps_.Add(state);
  // At rest the simulator repeats its last state. In a thinned log only the repetition may have the
  // shape.
  if (last_state_ && state.tick == last_state_->tick) {
    if (!last_shape_ || last_shape_->tick != state.tick) TakeShape(state);
    return;
  }
  course_.Add(state);
  ++report_.states;
  report_.max_penetration_um = std::max(report_.max_penetration_um, state.max_penetration_um);
  solve_us_.push_back(state.solve_us);
  if (last_state_) {
    const std::int64_t ticks = Difference(state.tick, last_state_->tick);
    if (ticks > 1) report_.states_missing = Sum(report_.states_missing, ticks - 1);
  }
  for (const torquer_lcm::instrument_state_t& instrument : state.instruments) {
    Channel& channel = channels_[instrument.name];
    // Times from the clocks of two machines cannot be subtracted.
    if (instrument.command_sequence > channel.shown_sequence &&
        state.clock_id == channel.command_clock_id) {
      channel.latencies_ms.push_back(
          static_cast<double>(Difference(state.publish_us, instrument.origin_us)) * 1e-3);
    }
    Show(channel, instrument.origin_us);
    channel.shown_sequence = instrument.command_sequence;
  }
  if (!last_state_) {
    first_state_us_ = state.publish_us;
    first_tick_ = state.tick;
  }
  last_state_ = state;
  TakeShape(state);
}

void SessionReporter::TakeShape(const torquer_lcm::wire_state_t& state) {
  if (bus::IsOutline(state)) return;
  ++report_.shapes;
  last_shape_ = state;
  for (std::size_t k = 0; k < state.instruments.size(); ++k) {
    Channel& channel = channels_[state.instruments[k].name];
    channel.shown_with_shape = channel.shown;
    if (!channel.begin && channel.first_sample &&
        channel.shown.origin_us == state.instruments[k].origin_us) {
      channel.begin = channel.shown;
      channel.begin_wire = PositionOf(state, k);
    }
  }
}

// Each message has all exchanges since the start.
void SessionReporter::Add(const torquer_lcm::devices_t& devices) {
  if (devices.exchange_device.size() < exchanges_.size()) return;
  exchanges_.clear();
  for (std::size_t k = 0; k < devices.exchange_device.size(); ++k) {
    const auto instrument = static_cast<std::size_t>(devices.exchange_instrument[k]);
    const bool named = instrument < devices.instruments.size();
    exchanges_.push_back({devices.exchange_time_s[k],
                          named ? devices.instruments[instrument] : std::string("?"),
                          devices.exchange_device[k]});
  }
}

void SessionReporter::Add(const torquer_lcm::readings_t& readings) {
  gaps_.Add(readings);
  course_.Add(readings);
  readings_ = readings;
}

void SessionReporter::Add(const torquer_lcm::health_t& health) {
  gaps_.Add(health);
  if (health.process != "daemon") return;
  Channel& channel = channels_[health.instrument];
  for (std::size_t i = 0; i < health.names.size(); ++i) {
    channel.daemon_counters[health.names[i]] = health.values[i];
    if (health.names[i] == "healed_um" && !channel.first_healed_um) {
      channel.first_healed_um = health.values[i];
    }
  }
  channel.counted_us = health.publish_us;
  channel.ended = health.state == kStopping;
  if (!channel.first_sample) return;
  const auto found = truths_.find(channel.first_sample->device);
  if (found != truths_.end()) channel.truth = found->second;
}

// A truth message sent before the daemon's counters may arrive after them.
void SessionReporter::Add(const torquer_lcm::hand_motion_t& truth) {
  gaps_.Add(truth);
  truths_[truth.device] = truth;
  for (auto& [name, channel] : channels_) {
    if (channel.first_sample && channel.first_sample->device == truth.device &&
        truth.publish_us <= channel.counted_us) {
      channel.truth = truth;
    }
  }
}

void SessionReporter::CountReports(const Channel& channel, InstrumentReport& report) {
  const auto counter = [&channel](const std::string& name) -> std::optional<std::int64_t> {
    const auto found = channel.daemon_counters.find(name);
    if (found == channel.daemon_counters.end() || found->second < 0) return std::nullopt;
    return found->second;
  };
  // The device numbers all sampled frames; the emulator counts only reports that the host fetched.
  // The emulator's count is from the time of the daemon's last counters or slightly earlier, never
  // later. A later count would turn reports that the daemon had yet to count into losses.
  const std::optional<std::int64_t> gaps = counter("reports_lost");
  report.reports_received = counter("reports_received");
  report.reports_lost = gaps;
  if (channel.truth && report.reports_received && gaps) {
    const std::int64_t lost_on_the_way = std::max<std::int64_t>(
        Difference(channel.truth->reports_sent, *report.reports_received), 0);
    const std::int64_t unfetched = std::max<std::int64_t>(Difference(*gaps, lost_on_the_way), 0);
    report.reports_unfetched = unfetched;
    report.reports_lost = Sum(lost_on_the_way, unfetched);
    report.reports_sent = Sum(*report.reports_received, *report.reports_lost);
  }
}

// True if the hand of an emulator moved on after `truth`.
bool SessionReporter::MovedOn(const torquer_lcm::hand_motion_t& truth) const {
  const torquer_lcm::hand_motion_t& last = truths_.at(truth.device);
  return last.axial_counts != truth.axial_counts ||
         last.transverse_counts != truth.transverse_counts;
}

void SessionReporter::JudgeMotion(const Channel& channel, std::size_t index,
                                  const Eigen::Matrix2d& per_count,
                                  InstrumentReport& report) const {
  // At the end of a session the counts of the emulator's sensor are used if known. They reveal a
  // loss of the last report. A reset restarts the samples' counts, but not the emulator's. If the
  // log ends before the session, the last state shows the hand at an earlier sample. The same holds
  // if the last states have no shape.
  if (!channel.ended || last_shape_->tick != last_state_->tick) {
    report.axial = channel.shown_with_shape.axial;
    report.rotation = channel.shown_with_shape.rotation;
  } else if (channel.truth && report.resets == 0 && !MovedOn(*channel.truth)) {
    report.axial.sensor_counts =
        Difference(channel.truth->axial_counts, channel.first_sample->axial_counts);
    report.rotation.sensor_counts =
        Difference(channel.truth->transverse_counts, channel.first_sample->transverse_counts);
  }

  // A log that begins in mid-session, such as a later part, does not contain the earlier motion.
  const bool late = first_tick_ > 0 && channel.begin;
  const Motion begin = late ? *channel.begin : Motion();
  const auto moved = [](const MotionAgreement& motion, const MotionAgreement& before) {
    return static_cast<double>(Difference(motion.sensor_counts, motion.held_counts)) -
           static_cast<double>(Difference(before.sensor_counts, before.held_counts));
  };
  const Eigen::Vector2d hand = per_count * Eigen::Vector2d(moved(report.axial, begin.axial),
                                                           moved(report.rotation, begin.rotation));
  const Eigen::Vector2d wire =
      PositionOf(*last_shape_, index) -
      (late ? channel.begin_wire : Eigen::Vector2d(scene_->inserted_at_start_mm[index], 0));
  const auto healed_um = channel.daemon_counters.find("healed_um");
  if (healed_um != channel.daemon_counters.end()) {
    report.healed_mm = 1e-3 * static_cast<double>(Difference(healed_um->second,
                                                             late ? *channel.first_healed_um : 0));
  }
  const Eigen::Vector2d error_counts =
      per_count.inverse() * (wire - hand - Eigen::Vector2d(report.healed_mm.value_or(0), 0));
  report.axial.hand = hand[0];
  report.axial.wire = wire[0];
  report.axial.error_counts = std::abs(error_counts[0]);
  report.rotation.hand = hand[1];
  report.rotation.wire = wire[1];
  report.rotation.error_counts = std::abs(error_counts[1]);
}

SessionReport SessionReporter::Finish(const MotionPerCount& motion_per_count) const {
  const auto require = [](bool present, const std::string& what, const std::string& who) {
    if (present) return;
    throw UserError("the log holds no " + what + "; record while " + who + " runs");
  };
  require(scene_.has_value(), "scene description", "torquer-simulator");
  require(last_state_.has_value(), "wire state", "torquer-simulator");
  require(last_shape_.has_value(), "wire state with its shape", "torquer-simulator");

  SessionReport report = report_;
  report.scene = scene_->name;
  report.scene_file = scene_->scene_file;
  report.method = scene_->method;
  report.ended = true;
  std::int64_t first_us = std::numeric_limits<std::int64_t>::max();
  std::int64_t last_us = 0;
  for (std::size_t k = 0; k < last_shape_->instruments.size(); ++k) {
    const auto found = channels_.find(last_shape_->instruments[k].name);
    const Channel& channel = found->second;
    InstrumentReport one = channel.report;
    one.name = found->first;
    if (channel.first_sample && k < scene_->inserted_at_start_mm.size()) {
      one.device = channel.first_sample->device;
      first_us = std::min(first_us, channel.first_sample->receive_us);
      last_us = std::max(last_us, channel.last_sample->receive_us);
      one.duration_s = 1e-6 * static_cast<double>(Difference(channel.last_sample->receive_us,
                                                             channel.first_sample->receive_us));
      report.ended = report.ended && channel.ended;
      CountReports(channel, one);
      JudgeMotion(channel, k, motion_per_count(one.device, channel.first_sample->cpi), one);
    }
    std::vector<double> latencies = channel.latencies_ms;
    one.latency_ms = Distribute(latencies);
    report.instruments.push_back(std::move(one));
  }
  if (last_us == 0) {
    // No device sample: a page or a program may have steered.
    const bool steered = std::any_of(report.instruments.begin(), report.instruments.end(),
                                     [](const InstrumentReport& one) { return one.commands > 0; });
    require(steered, "device sample and no command", "torquer-daemon or a page that steers");
    first_us = first_state_us_;
    last_us = last_state_->publish_us;
  }
  report.duration_s = static_cast<double>(Difference(last_us, first_us)) * 1e-6;
  std::vector<double> solve = solve_us_;
  report.solve_us = Distribute(solve);
  report.residual = last_state_->residual;
  report.status = last_state_->status;
  report.description = *scene_;
  report.last_state = *last_shape_;
  report.first_tick = first_tick_;
  report.ticks_after_shape =
      std::max<std::int64_t>(Difference(last_state_->tick, last_shape_->tick), 0);
  report.readings = readings_;
  report.exchanges = exchanges_;
  report.course = course_;
  report.solver = course_.solver();
  report.gaps = gaps_.Describe();
  report.silences = gaps_.DescribeSilences();
  return report;
}

}  // namespace torquer
