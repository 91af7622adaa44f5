#include "host/tools/live_status.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>
#include <numbers>
#include <utility>

#include "host/bus/channels.h"

namespace torquer::tools {
namespace {

constexpr std::array<std::pair<std::int32_t, const char*>, 5> kStatusWords = {{
    {bus::kWireBudgetSpent, "out of time"},
    {bus::kWireOutsideLumen, "outside the lumen"},
    {bus::kWireSnapped, "snapped"},
    {bus::kWireInputRefused, "input refused"},
    {bus::kWireInDoubt, "in doubt"},
}};

std::string LatencyText(std::vector<double>& latencies_ms) {
  if (latencies_ms.empty()) return "latency -";
  std::sort(latencies_ms.begin(), latencies_ms.end());
  char text[64];
  std::snprintf(text, sizeof text, "latency %.2f ms (worst %.2f)",
                latencies_ms[latencies_ms.size() / 2], latencies_ms.back());
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
  if (state.instrument != bus::kGuidewire) return;
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

std::string LiveStatus::Line(double interval_s) {
  char text[256];
  std::snprintf(text, sizeof text, "%s | %.0f reports/s, %lld lost | %.0f states/s, ",
                scene_.c_str(), static_cast<double>(samples_) / interval_s,
                static_cast<long long>(reports_lost_), static_cast<double>(states_) / interval_s);
  std::string line = text + LatencyText(latencies_ms_);
  if (state_) {
    std::snprintf(
        text, sizeof text, " | %.2f mm, %+.0f deg | residual %.1e, wall %.1f um, %s | device %s",
        state_->insertion_mm, state_->rotation_rad * 180 / std::numbers::pi, state_->residual,
        max_penetration_um_, StatusWords(state_->status).c_str(), device_state_.c_str());
    line += text;
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
