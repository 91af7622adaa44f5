#include "host/recorder/session_report.h"

#include <Eigen/LU>
#include <algorithm>
#include <cmath>
#include <utility>

#include "host/support/error.h"
#include "protocol/hid_reports.h"
#include "protocol/lcm_channels.h"

namespace torquer {
namespace {

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
  result.max = values.back();
  return result;
}

double ArcLengthMm(const torquer_lcm::wire_state_t& state) {
  double length_mm = 0;
  for (std::size_t i = 1; i < state.nodes_mm.size(); ++i) {
    double square = 0;
    for (std::size_t axis = 0; axis < 3; ++axis) {
      const double step = static_cast<double>(state.nodes_mm[i][axis]) -
                          static_cast<double>(state.nodes_mm[i - 1][axis]);
      square += step * step;
    }
    length_mm += std::sqrt(square);
  }
  return length_mm;
}

SessionReporter::SessionReporter(std::string instrument) : instrument_(std::move(instrument)) {}

SessionHandlers SessionReporter::Handlers() {
  SessionHandlers handlers;
  handlers.sample = [this](const torquer_lcm::device_sample_t& message) { Add(message); };
  handlers.command = [this](const torquer_lcm::instrument_command_t& message) { Add(message); };
  handlers.state = [this](const torquer_lcm::wire_state_t& message) { Add(message); };
  handlers.scene = [this](const torquer_lcm::scene_description_t& message) { scene_ = message; };
  handlers.readings = [this](const torquer_lcm::readings_t& message) { readings_ = message; };
  handlers.health = [this](const torquer_lcm::health_t& message) { Add(message); };
  handlers.truth = [this](const torquer_lcm::hand_motion_t& message) { truth_ = message; };
  return handlers;
}

// The clutch and the sensor's own doubts stand in the sample; that the daemon found the surface
// poor stands only in the command that it made of it, just before.
bool SessionReporter::Held(const torquer_lcm::device_sample_t& sample) const {
  const bool doubted = command_origin_us_ == sample.origin_us && command_doubtful_;
  return (sample.buttons & protocol::kButtonClutch) != 0 || (sample.flags & kDoubtfulSample) != 0 ||
         doubted;
}

void SessionReporter::Add(const torquer_lcm::device_sample_t& sample) {
  ++report_.samples;
  const bool held = Held(sample);
  if (!first_sample_) first_sample_ = sample;
  if (last_sample_) {
    // What the hand did while the device restarted, nobody knows.
    const bool reset = sample.boot_id != last_sample_->boot_id;
    resets_ += reset ? 1 : 0;
    const std::int64_t axial = reset ? 0 : sample.axial_counts - last_sample_->axial_counts;
    const std::int64_t transverse =
        reset ? 0 : sample.transverse_counts - last_sample_->transverse_counts;
    report_.axial.sensor_counts += axial;
    report_.rotation.sensor_counts += transverse;
    // Motion is held when there was a reason for it at either end.
    if (held || last_held_) {
      report_.axial.held_counts += axial;
      report_.rotation.held_counts += transverse;
    }
  }
  last_held_ = held;
  last_sample_ = sample;
}

void SessionReporter::Add(const torquer_lcm::instrument_command_t& command) {
  if (command.instrument != instrument_) return;
  ++report_.commands;
  command_clock_id_ = command.clock_id;
  command_origin_us_ = command.origin_us;
  command_doubtful_ = (command.flags & kDoubtfulCommand) != 0;
}

void SessionReporter::Add(const torquer_lcm::wire_state_t& state) {
  if (state.instrument != instrument_) return;
  ++report_.states;
  report_.max_penetration_um = std::max(report_.max_penetration_um, state.max_penetration_um);
  solve_us_.push_back(state.solve_us);
  if (last_state_) {
    report_.states_missing += std::max<std::int64_t>(state.tick - last_state_->tick - 1, 0);
  }
  const std::int64_t shown_before = last_state_ ? last_state_->command_sequence : -1;
  // Times of two machines' clocks cannot be subtracted.
  if (state.command_sequence > shown_before && state.clock_id == command_clock_id_) {
    latencies_ms_.push_back(static_cast<double>(state.publish_us - state.origin_us) * 1e-3);
  }
  last_state_ = state;
}

void SessionReporter::Add(const torquer_lcm::health_t& health) {
  if (health.process != "daemon") return;
  for (std::size_t i = 0; i < health.names.size(); ++i) {
    daemon_counters_[health.names[i]] = health.values[i];
  }
}

void SessionReporter::CountReports(SessionReport& report) const {
  const auto counter = [this](const std::string& name) {
    const auto found = daemon_counters_.find(name);
    return found == daemon_counters_.end() ? -1 : found->second;
  };
  // The device numbers the frames in which it sampled, fetched by the host or not; the emulator
  // counts what was fetched.
  const std::int64_t gaps = counter("reports_lost");
  report.reports_received = counter("reports_received");
  report.reports_lost = gaps;
  if (truth_ && report.reports_received >= 0) {
    const std::int64_t lost_on_the_way = truth_->reports_sent - report.reports_received;
    report.reports_unfetched = std::max<std::int64_t>(gaps - lost_on_the_way, 0);
    report.reports_sent = truth_->reports_sent + report.reports_unfetched;
    report.reports_lost = report.reports_sent - report.reports_received;
  }
}

void SessionReporter::JudgeMotion(const Eigen::Matrix2d& motion_per_count,
                                  SessionReport& report) const {
  // Where the emulator tells what its sensor produced, that counts: a report that was lost at the
  // end would show. Its counts go on through a reset of the device, the samples' start again.
  if (truth_ && resets_ == 0) {
    report.axial.sensor_counts = truth_->axial_counts - first_sample_->axial_counts;
    report.rotation.sensor_counts = truth_->transverse_counts - first_sample_->transverse_counts;
  }

  const Eigen::Vector2d moved_counts(
      static_cast<double>(report.axial.sensor_counts - report.axial.held_counts),
      static_cast<double>(report.rotation.sensor_counts - report.rotation.held_counts));
  const Eigen::Vector2d hand = motion_per_count * moved_counts;
  // The published nodes are what anyone downstream sees, so their length counts, not the field
  // that repeats the command.
  const Eigen::Vector2d wire(
      ArcLengthMm(*last_state_) + last_state_->carried_mm - scene_->inserted_at_start_mm,
      last_state_->rotation_rad);
  const Eigen::Vector2d error_counts = motion_per_count.inverse() * (wire - hand);
  report.axial.hand = hand[0];
  report.axial.wire = wire[0];
  report.axial.error_counts = std::abs(error_counts[0]);
  report.rotation.hand = hand[1];
  report.rotation.wire = wire[1];
  report.rotation.error_counts = std::abs(error_counts[1]);
}

SessionReport SessionReporter::Finish(const Eigen::Matrix2d& motion_per_count) const {
  const auto require = [](bool present, const std::string& what, const std::string& who) {
    if (present) return;
    throw UserError("the log holds no " + what + "; record while " + who + " runs");
  };
  require(scene_.has_value(), "scene description", "torquer-simulator");
  require(last_state_.has_value(), "wire state of the " + instrument_, "torquer-simulator");
  require(first_sample_.has_value(), "device sample", "torquer-daemon");

  SessionReport report = report_;
  report.scene = scene_->name;
  report.scene_file = scene_->scene_file;
  report.method = scene_->method;
  report.duration_s =
      static_cast<double>(last_sample_->receive_us - first_sample_->receive_us) * 1e-6;
  CountReports(report);
  JudgeMotion(motion_per_count, report);
  std::vector<double> latencies = latencies_ms_;
  report.latency_ms = Distribute(latencies);
  std::vector<double> solve = solve_us_;
  report.solve_us = Distribute(solve);
  report.residual = last_state_->residual;
  report.status = last_state_->status;
  report.description = *scene_;
  report.last_state = *last_state_;
  report.readings = readings_;
  return report;
}

}  // namespace torquer
