#include "host/tools/live_status.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <string_view>
#include <utility>

#include "host/support/angle.h"
#include "host/support/printable_text.h"
#include "protocol/lcm_channels.h"

namespace torquer::tools {
namespace {

// Larger latencies mean that a time in a message is wrong.
constexpr double kLongestLatencyUs = 60e6;
// Limit of a count from a message, so that sums cannot overflow.
constexpr std::int64_t kMostLost = 1'000'000'000'000;

constexpr std::array<std::pair<std::int32_t, const char*>, 7> kStatusWords = {{
    {protocol::kWireBudgetSpent, "out of time"},
    {protocol::kWireOutsideLumen, "outside the lumen"},
    {protocol::kWireLeftModel, "left the model"},
    {protocol::kWireStalled, "stalled"},
    {protocol::kWireSnapped, "snapped"},
    {protocol::kWireInputRefused, "input refused"},
    {protocol::kWireInDoubt, "in doubt"},
}};

std::string LatencyText(std::vector<double>& latencies_ms) {
  if (latencies_ms.empty()) return "latency -";
  std::sort(latencies_ms.begin(), latencies_ms.end());
  return fmt::format("latency {:.2f} ms (worst {:.2f})", latencies_ms[latencies_ms.size() / 2],
                     latencies_ms.back());
}

std::string ForceText(const std::map<std::string, double>& readings) {
  const auto value = [&](const char* name, int digits = 3) -> std::string {
    const auto found = readings.find(name);
    const bool known = found != readings.end() && std::isfinite(found->second);
    return known ? fmt::format("{:.{}g}", found->second, digits) : "-";
  };
  if (readings.count("wall_force_events") == 0) return "";
  return fmt::format(" | force {} mN, sum {}, most {}, {} events", value("wall_force_largest_mN"),
                     value("wall_force_sum_mN"), value("wall_force_largest_ever_mN"),
                     value("wall_force_events", 9));
}

// Limits names of instruments and devices to 40 characters.
std::string Name(const std::string& text) { return Printable(text, 40); }

// Age in whole seconds.
std::string Age(std::int64_t heard_us, std::int64_t now_us) {
  return fmt::format("{} s", (now_us - heard_us) / 1'000'000);
}

}  // namespace

std::string StatusWords(std::int32_t status) {
  std::string words;
  for (const auto& [bit, word] : kStatusWords) {
    if ((status & bit) != 0) words += (words.empty() ? "" : ", ") + std::string(word);
  }
  return words.empty() ? "ok" : words;
}

void LiveStatus::Add(const torquer_lcm::device_sample_t&) { ++samples_; }

void LiveStatus::Add(const torquer_lcm::scene_description_t& scene, const bus::Sender& sender) {
  scene_ = Name(scene.name);
  simulators_.Scene(sender, scene.name);
}

void LiveStatus::Add(const torquer_lcm::wire_state_t& state, const bus::Sender& sender,
                     std::int64_t now_us) {
  ++states_;
  simulators_.State(sender, now_us);
  state_heard_us_ = now_us;
  max_penetration_um_ = std::max(max_penetration_um_, state.max_penetration_um);
  state_ = state;
  if (state_->instruments.size() > kMostShown) state_->instruments.resize(kMostShown);
  // Another simulator may have other instruments.
  std::erase_if(command_sequences_, [this](const auto& entry) {
    return std::none_of(state_->instruments.begin(), state_->instruments.end(),
                        [&](const auto& instrument) { return instrument.name == entry.first; });
  });
  for (const torquer_lcm::instrument_state_t& instrument : state_->instruments) {
    std::int64_t& shown = command_sequences_.try_emplace(instrument.name, -1).first->second;
    const double latency_us =
        static_cast<double>(state.publish_us) - static_cast<double>(instrument.origin_us);
    if (state.clock_id == clock_id_ && instrument.command_sequence > shown && latency_us >= 0 &&
        latency_us < kLongestLatencyUs) {
      latencies_ms_.push_back(1e-3 * latency_us);
    }
    shown = instrument.command_sequence;
  }
}

std::string LiveStatus::Add(const torquer_lcm::health_t& health, std::int64_t now_us) {
  if (health.process == "daemon") {
    if (daemons_.size() >= kMostShown && !daemons_.contains(health.instrument)) {
      daemons_.erase(
          std::min_element(daemons_.begin(), daemons_.end(), [this](const auto& a, const auto& b) {
            const auto rank = [this](const auto& one) {
              return std::pair(state_ && HasInstrument(one.first), one.second.heard_us);
            };
            return rank(a) < rank(b);
          }));
    }
    Daemon& daemon = daemons_[health.instrument];
    daemon.state = Name(health.state);
    daemon.heard_us = now_us;
    for (std::size_t i = 0; i < health.names.size(); ++i) {
      if (health.names[i] == "reports_lost") {
        daemon.reports_lost = std::clamp(health.values[i], std::int64_t{0}, kMostLost);
      }
    }
  }
  if (health.message.empty()) return "";
  const std::string& of = health.instrument.empty() ? health.device : health.instrument;
  return fmt::format("{}{}: {}: {}", Name(health.process), of.empty() ? "" : " of " + Name(of),
                     Name(health.state), Printable(health.message));
}

// True if the scene has this instrument; also true before the first state.
bool LiveStatus::HasInstrument(const std::string& name) const {
  return !state_ || std::any_of(state_->instruments.begin(), state_->instruments.end(),
                                [&](const auto& instrument) { return instrument.name == name; });
}

std::string LiveStatus::Devices(std::int64_t now_us) const {
  const auto state = [&](const std::string& instrument, const Daemon& daemon) {
    const std::string lacking = HasInstrument(instrument) || instrument.empty()
                                    ? ""
                                    : ", an instrument that the scene does not have";
    return now_us - daemon.heard_us < kHealthOldUs ? daemon.state + lacking
                                                   : "silent for " + Age(daemon.heard_us, now_us);
  };
  if (daemons_.empty()) return "device no daemon";
  const auto& [first, only] = *daemons_.begin();
  if (daemons_.size() == 1) {
    return "device " + (HasInstrument(first) || first.empty() ? "" : Name(first) + " ") +
           state(first, only);
  }
  std::string text;
  for (const auto& [instrument, daemon] : daemons_) {
    text += fmt::format("{} {} {}", text.empty() ? "devices" : ",", Name(instrument),
                        state(instrument, daemon));
  }
  return text;
}

// The reports that all daemons lost; "-" if that is not known.
std::string LiveStatus::ReportsLost() const {
  std::int64_t lost = 0;
  bool all = !daemons_.empty();
  for (const auto& [instrument, daemon] : daemons_) {
    lost += daemon.reports_lost.value_or(0);
    all = all && daemon.reports_lost;
  }
  if (all) return std::to_string(lost);
  return lost > 0 ? fmt::format("at least {}", lost) : "-";
}

std::string LiveStatus::Instruments(std::int64_t now_us) const {
  if (!state_) return " | no wire yet";
  std::string text;
  for (const torquer_lcm::instrument_state_t& instrument : state_->instruments) {
    text += fmt::format(" | {} {:.2f} mm, {:+.0f} deg", Name(instrument.name),
                        instrument.insertion_mm, instrument.rotation_rad * kDegreesPerRad);
  }
  return text + " | " +
         (now_us - state_heard_us_ < kStateOldUs
              ? StatusWords(state_->status) + ForceText(readings_)
              : "simulator silent for " + Age(state_heard_us_, now_us) +
                    ", showing its last values");
}

std::string LiveStatus::Add(const torquer_lcm::readings_t& readings) {
  std::map<std::string, double> now;
  for (std::size_t i = 0; i < readings.names.size(); ++i)
    now[readings.names[i]] = readings.values[i];
  readings_.swap(now);
  const std::map<std::string, double>& before = now;
  // The first readings only give the initial values, not a change.
  if (before.empty()) return "";
  const auto grown = [&](const std::string& name) {
    const auto was = before.find(name);
    const auto is = readings_.find(name);
    // A count that was not known before has grown from 0.
    return was != before.end() && is != readings_.end() &&
           is->second > (std::isnan(was->second) ? 0 : was->second);
  };
  std::string news;
  if (grown("wall_force_events")) {
    news =
        fmt::format("wall force: event {:.0f}: above the threshold at {:.2f} s, {:.3g} mN so far",
                    readings_["wall_force_events"], readings_["wall_force_event_s"],
                    readings_["wall_force_event_mN"]);
  }
  if (grown("left_model_events")) {
    news += fmt::format("{}outlets: an instrument left the model at {:.2f} s",
                        news.empty() ? "" : "; ", readings_["left_model_event_s"]);
  }
  if (grown("target_reached")) {
    news += fmt::format("{}assessment: target reached at {:.2f} s", news.empty() ? "" : "; ",
                        readings_["target_reached_s"]);
  }
  return news;
}

std::string FittingParts(const std::string& line, std::size_t columns) {
  if (line.size() <= columns) return line;
  // The separator may lie beyond the last column.
  const std::size_t end = columns == 0 ? 0 : line.rfind(" | ", columns);
  if (columns > 0 && end != std::string::npos) return line.substr(0, end);
  constexpr std::string_view kCut = "...";
  if (columns < kCut.size()) return line.substr(0, columns);
  return line.substr(0, columns - kCut.size()).append(kCut);
}

std::string LiveStatus::Line(double interval_s, std::int64_t now_us) {
  // The most important data comes first: a narrow terminal leaves out the end.
  const std::string conflict = simulators_.Conflict(now_us);
  std::string line = (conflict.empty() ? scene_ : conflict) + Instruments(now_us);
  line += fmt::format(" | {} | {:.0f} reports/s, {} lost | {:.0f} states/s, {}", Devices(now_us),
                      static_cast<double>(samples_) / interval_s, ReportsLost(),
                      static_cast<double>(states_) / interval_s, LatencyText(latencies_ms_));
  if (state_) {
    line +=
        fmt::format(" | residual {:.1e}, wall {:.1f} um", state_->residual, max_penetration_um_);
  }
  samples_ = 0;
  states_ = 0;
  if (state_) max_penetration_um_ = state_->max_penetration_um;
  latencies_ms_.clear();
  return line;
}

}  // namespace torquer::tools
