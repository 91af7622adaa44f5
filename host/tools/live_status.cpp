#include "host/tools/live_status.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>
#include <numbers>
#include <utility>

#include "protocol/lcm_channels.h"

namespace torquer::tools {
namespace {

constexpr std::array<std::pair<std::int32_t, const char*>, 5> kStatusWords = {{
    {protocol::kWireBudgetSpent, "out of time"},
    {protocol::kWireOutsideLumen, "outside the lumen"},
    {protocol::kWireSnapped, "snapped"},
    {protocol::kWireInputRefused, "input refused"},
    {protocol::kWireInDoubt, "in doubt"},
}};

std::string LatencyText(std::vector<double>& latencies_ms) {
  if (latencies_ms.empty()) return "latency -";
  std::sort(latencies_ms.begin(), latencies_ms.end());
  char text[64];
  std::snprintf(text, sizeof text, "latency %.2f ms (worst %.2f)",
                latencies_ms[latencies_ms.size() / 2], latencies_ms.back());
  return text;
}

std::string ForceText(const std::map<std::string, double>& readings) {
  const auto value = [&](const char* name) {
    const auto found = readings.find(name);
    return found == readings.end() ? 0 : found->second;
  };
  if (readings.count("wall_force_events") == 0) return "";
  char text[160];
  std::snprintf(text, sizeof text, " | force %.3g mN, sum %.3g, most %.3g, %.0f events",
                value("wall_force_largest_mN"), value("wall_force_sum_mN"),
                value("wall_force_largest_ever_mN"), value("wall_force_events"));
  return text;
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

void LiveStatus::Add(const torquer_lcm::wire_state_t& state) {
  if (state.instrument != protocol::kGuidewire) return;
  ++states_;
  max_penetration_um_ = std::max(max_penetration_um_, state.max_penetration_um);
  if (state.clock_id == clock_id_ && state.command_sequence > command_sequence_) {
    latencies_ms_.push_back(1e-3 * static_cast<double>(state.publish_us - state.origin_us));
  }
  command_sequence_ = state.command_sequence;
  state_ = state;
}

std::string LiveStatus::Add(const torquer_lcm::health_t& health) {
  if (health.process == "daemon") {
    device_state_ = health.state;
    for (std::size_t i = 0; i < health.names.size(); ++i) {
      if (health.names[i] == "reports_lost") reports_lost_ = health.values[i];
    }
  }
  if (health.message.empty()) return "";
  return health.process + ": " + health.state + ": " + health.message;
}

std::string LiveStatus::Add(const torquer_lcm::readings_t& readings) {
  std::map<std::string, double> now;
  for (std::size_t i = 0; i < readings.names.size(); ++i)
    now[readings.names[i]] = readings.values[i];
  readings_.swap(now);
  const std::map<std::string, double>& before = now;
  // What was so when this began to listen is no news.
  if (before.empty()) return "";
  const auto grown = [&](const std::string& name) {
    const auto was = before.find(name);
    const auto is = readings_.find(name);
    return was != before.end() && is != readings_.end() && is->second > was->second;
  };
  char text[160];
  std::string news;
  if (grown("wall_force_events")) {
    std::snprintf(text, sizeof text,
                  "wall force: event %.0f: above the threshold at %.2f s, %.3g mN so far",
                  readings_["wall_force_events"], readings_["wall_force_event_s"],
                  readings_["wall_force_event_mN"]);
    news = text;
  }
  if (grown("target_reached")) {
    std::snprintf(text, sizeof text, "%sassessment: target reached at %.2f s",
                  news.empty() ? "" : "; ", readings_["target_reached_s"]);
    news += text;
  }
  return news;
}

std::string LiveStatus::Line(double interval_s) {
  char text[256];
  std::snprintf(text, sizeof text, "%s | %.0f reports/s, %lld lost | %.0f states/s, ",
                scene_.c_str(), static_cast<double>(samples_) / interval_s,
                static_cast<long long>(reports_lost_), static_cast<double>(states_) / interval_s);
  std::string line = text + LatencyText(latencies_ms_);
  if (state_) {
    std::snprintf(text, sizeof text, " | %.2f mm, %+.0f deg | residual %.1e, wall %.1f um, %s",
                  state_->insertion_mm, state_->rotation_rad * 180 / std::numbers::pi,
                  state_->residual, max_penetration_um_, StatusWords(state_->status).c_str());
    line += text + ForceText(readings_) + " | device " + device_state_;
  } else {
    line += " | no wire yet | device " + device_state_;
  }
  samples_ = 0;
  states_ = 0;
  max_penetration_um_ = 0;
  latencies_ms_.clear();
  return line;
}

}  // namespace torquer::tools
