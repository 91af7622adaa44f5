#include "host/viewer/replay.h"

#include <fmt/format.h>

#include <chrono>
#include <cmath>
#include <cstdio>
#include <nlohmann/json.hpp>
#include <optional>
#include <torquer_lcm/wire_forces_t.hpp>
#include <torquer_lcm/wire_state_t.hpp>
#include <vector>

#include "host/bus/clock.h"
#include "host/bus/message_check.h"
#include "host/viewer/page_messages.h"
#include "host/viewer/page_server.h"
#include "host/viewer/playback.h"
#include "host/viewer/show_scene.h"
#include "protocol/lcm_channels.h"

namespace torquer::viewer {
namespace {

constexpr std::chrono::milliseconds kReplayBeat{16};

class Replayer {
 public:
  Replayer(const Recording& recording, int listening_socket, const std::string& token,
           const std::atomic<bool>& stop)
      : recording_(recording),
        stop_(stop),
        playback_(recording.length_us(), recording.states().times_us),
        shown_(recording.topics().size()),
        server_(
            listening_socket, token,
            [this](PageId, std::span<const std::uint8_t> message) {
              const auto controls = ReadReplayControls(message);
              if (controls) playback_.Take(*controls);
              return controls.has_value();
            },
            [](PageId) {}) {
    server_.Every(kReplayBeat, [this] { Beat(); });
  }

  PageServer& server() { return server_; }

  void Run(const HashCheck* check) {
    check_ = check;
    server_.Run();
  }

 private:
  void Beat() {
    if (stop_) return server_.Stop();
    const std::int64_t now_us = bus::MonotonicUs();
    playback_.Advance(now_us);
    for (std::size_t t = 0; t < shown_.size(); ++t) {
      const Recording::Topic& topic = recording_.topics()[t];
      const std::size_t count = topic.CountAt(playback_.at_us());
      if (count == shown_[t]) continue;
      shown_[t] = count;
      if (count > 0) Show(topic, recording_.Read(topic, count - 1));
    }
    if (now_us - summary_us_ < kSummaryUs) return;
    summary_us_ = now_us;
    Summarize();
  }

  template <class Message>
  static std::optional<Message> Decode(const std::vector<std::uint8_t>& bytes) {
    Message message{};
    if (!bus::DecodeMessage(bytes.data(), bytes.size(), message)) return {};
    return message;
  }

  // Bytes that do not decode as the type of their channel are skipped, as on the bus.
  void Show(const Recording::Topic& topic, const std::vector<std::uint8_t>& bytes) {
    using namespace torquer_lcm;  // NOLINT(google-build-using-namespace)
    if (topic.channel == protocol::kWireStateChannel) {
      const auto state = Decode<wire_state_t>(bytes);
      // Uses the recording's clock, so that the page shows its latencies.
      if (state) server_.ShowBytes("state", StateFrame(*state, ForcesNow(), state->clock_id));
    } else if (topic.channel == protocol::kPictureChannel) {
      if (const auto picture = Decode<picture_t>(bytes)) {
        server_.ShowBytes("picture", PictureFrame(*picture));
      }
    } else if (topic.channel == protocol::kLateralPictureChannel) {
      if (const auto picture = Decode<picture_t>(bytes)) {
        server_.ShowBytes("picture/lateral", PictureFrame(*picture, true));
      }
    } else if (topic.channel == protocol::kSceneChannel) {
      if (const auto scene = Decode<scene_description_t>(bytes)) {
        server_.ShowText("scene", SceneText(*scene));
      }
    } else if (topic.channel == protocol::kDevicesChannel) {
      if (const auto devices = Decode<devices_t>(bytes)) {
        server_.ShowText("devices", DevicesText(*devices));
      }
    } else if (topic.channel == protocol::kReadingsChannel) {
      if (const auto readings = Decode<readings_t>(bytes)) {
        server_.ShowText("readings", ReadingsText(*readings));
      }
    } else if (topic.channel == protocol::kVitalSignsChannel) {
      if (const auto vitals = Decode<vital_signs_t>(bytes)) {
        server_.ShowText("patient", PatientText(*vitals));
      }
    } else if (topic.channel == protocol::kHealthChannel) {
      if (const auto health = Decode<health_t>(bytes)) {
        server_.ShowText(topic.name, HealthText(*health));
      }
    }
  }

  // The newest forces; null without forces.
  const torquer_lcm::wire_forces_t* ForcesNow() {
    for (const Recording::Topic& topic : recording_.topics()) {
      if (topic.channel != protocol::kWireForcesChannel) continue;
      const std::size_t count = topic.CountAt(playback_.at_us());
      if (count == 0) return nullptr;
      forces_ = Decode<torquer_lcm::wire_forces_t>(recording_.Read(topic, count - 1));
      return forces_ ? &*forces_ : nullptr;
    }
    return nullptr;
  }

  void Summarize() {
    constexpr std::int64_t kSecondUs = 1'000'000;
    const Recording::Topic& states = recording_.states();
    const std::int64_t at_us = playback_.at_us();
    const std::size_t last_second = states.CountAt(at_us) - states.CountAt(at_us - kSecondUs);
    server_.ShowText("viewer", nlohmann::json({{"kind", "viewer"},
                                               {"steer", false},
                                               {"steered", false},
                                               {"page", 0},
                                               {"lao_rad", 0},
                                               {"cra_rad", 0},
                                               {"xray", false},
                                               {"contrast", false},
                                               {"mode", 0},
                                               {"pulses_per_s", 0},
                                               {"magnification", 1},
                                               {"shutters", {0, 0, 0, 0}},
                                               {"wedges", nlohmann::json::array()},
                                               {"states_per_s", last_second}})
                                   .dump());
    nlohmann::json text = {{"kind", "replay"},
                           {"at_s", 1e-6 * static_cast<double>(at_us)},
                           {"length_s", 1e-6 * static_cast<double>(recording_.length_us())},
                           {"playing", playback_.playing()},
                           {"speed", playback_.speed()},
                           {"states", states.times_us.size()},
                           {"damage", recording_.damage().Describe()},
                           {"check", nullptr}};
    if (check_ != nullptr) {
      const HashCheck::Finding finding = check_->Get();
      text["check"] = {{"states", finding.result.states},
                       {"missing", finding.result.missing},
                       {"differing", finding.result.differing},
                       {"first_difference", finding.result.first_difference},
                       {"done", finding.done},
                       {"error", finding.error}};
    }
    server_.ShowText("replay", text.dump(-1, ' ', false, nlohmann::json::error_handler_t::replace));
  }

  const Recording& recording_;
  const std::atomic<bool>& stop_;
  Playback playback_;
  std::vector<std::size_t> shown_;  // number of messages per topic
  std::optional<torquer_lcm::wire_forces_t> forces_;
  const HashCheck* check_ = nullptr;
  std::int64_t summary_us_ = 0;
  PageServer server_;  // last member, because it calls the others
};

}  // namespace

HashCheck::Finding RunReplay(const Recording& recording, const std::string& log,
                             int listening_socket, const std::string& token, SceneFrames frames,
                             scene::Scene* scene, const std::atomic<bool>& stop) {
  Replayer replayer(recording, listening_socket, token, stop);
  if (scene != nullptr) ShowFrames(std::move(frames), replayer.server());
  fmt::print("{}\n", replayer.server().url());
  std::fflush(stdout);
  if (scene == nullptr) {
    replayer.Run(nullptr);
    return {};
  }
  const HashCheck check(*scene, log);
  replayer.Run(&check);
  return check.Get();
}

}  // namespace torquer::viewer
