// A live scene, and hands that move its instruments over the bus.
#pragma once

#include <atomic>
#include <chrono>
#include <functional>
#include <memory>
#include <stdexcept>
#include <string>
#include <thread>
#include <torquer_lcm/devices_t.hpp>
#include <torquer_lcm/instrument_command_t.hpp>
#include <torquer_lcm/scene_description_t.hpp>
#include <torquer_lcm/wire_state_t.hpp>

#include "host/bus/bus.h"
#include "host/bus/clock.h"
#include "host/simulator/exchangeable_simulation.h"
#include "host/simulator/live_loop.h"
#include "host/simulator/scene/scene.h"
#include "protocol/lcm_channels.h"
#include "tests/simulator/state_log.h"

namespace torquer::test {

// Timeout that is long enough for any machine.
inline constexpr std::chrono::seconds kLongest{60};

// Handles messages of `bus` until `done`; false on timeout.
inline bool WaitFor(bus::Bus& bus, const std::function<bool()>& done) {
  const auto end = std::chrono::steady_clock::now() + kLongest;
  while (!done()) {
    if (std::chrono::steady_clock::now() > end) return false;
    bus.Handle(10);
  }
  return true;
}

// Live scene, and hands that move its instruments over the bus.
class LiveScene {
 public:
  explicit LiveScene(const std::string& scene_file) : scene_(scene_file), simulation_(scene_) {
    hands_.Subscribe<torquer_lcm::wire_state_t>(
        protocol::kWireStateChannel,
        [this](const torquer_lcm::wire_state_t& state) {
          state_ = state;
          if (log_) log_->Write(state);
        },
        0);
    hands_.Subscribe<torquer_lcm::devices_t>(
        protocol::kDevicesChannel,
        [this](const torquer_lcm::devices_t& devices) {
          devices_ = devices;
          if (log_) log_->Write(protocol::kDevicesChannel, devices);
        },
        0);
    hands_.Subscribe<torquer_lcm::scene_description_t>(
        protocol::kSceneChannel,
        [this](const torquer_lcm::scene_description_t& description) {
          description_ = description;
          if (log_) log_->Write(protocol::kSceneChannel, description);
        },
        0);
  }
  ~LiveScene() { Stop(); }
  LiveScene(const LiveScene&) = delete;
  LiveScene& operator=(const LiveScene&) = delete;

  /// Logs from the first state on.
  void LogTo(const std::string& path) { log_ = std::make_unique<StateLog>(path); }
  void Start() {
    thread_ = std::thread([this] { statistics_ = simulator::RunLive(simulation_, bus_, stop_); });
  }
  simulator::LiveStatistics Stop() {
    stop_ = true;
    if (thread_.joinable()) thread_.join();
    return statistics_;
  }

  // Newest command of all hands; a test may change fields that have no parameter.
  torquer_lcm::instrument_command_t command{};

  // Publishes a command repeatedly, because the simulator may not listen yet, until `done` is true.
  bool Send(const std::string& instrument, double insertion_mm, double rotation_rad,
            const std::function<bool()>& done) {
    ++command.sequence;
    command.instrument = instrument;
    command.clock_id = bus::ClockId();
    command.insertion_mm = insertion_mm;
    command.rotation_rad = rotation_rad;
    command.origin_us = command.publish_us = bus::MonotonicUs();
    return WaitFor(hands_, [&] {
      if (done()) return true;
      hands_.Publish(protocol::kInstrumentCommandChannel, command);
      return false;
    });
  }
  // Same until a state contains the command.
  bool SendAndSee(const std::string& instrument, double insertion_mm, double rotation_rad) {
    return Send(instrument, insertion_mm, rotation_rad,
                [&] { return HasState() && At(instrument).command_sequence == command.sequence; });
  }
  // Same until the instrument has arrived: a tick with too little time carries a remainder over.
  bool SendAndArrive(const std::string& instrument, double insertion_mm, double rotation_rad) {
    return Send(instrument, insertion_mm, rotation_rad, [&] {
      return HasState() && At(instrument).command_sequence == command.sequence &&
             At(instrument).carried_mm == 0 && At(instrument).carried_rad == 0;
    });
  }

  bool HasState() const { return !state_.instruments.empty(); }
  const torquer_lcm::wire_state_t& state() const { return state_; }
  const torquer_lcm::instrument_state_t& At(const std::string& instrument) const {
    for (const torquer_lcm::instrument_state_t& one : state_.instruments) {
      if (one.name == instrument) return one;
    }
    throw std::runtime_error("no state of " + instrument);
  }
  bus::Bus& hands() { return hands_; }
  const torquer_lcm::devices_t& devices() const { return devices_; }  // the newest
  const torquer_lcm::scene_description_t& description() const {
    return description_;
  }  // the newest

 private:
  scene::Scene scene_;
  simulator::ExchangeableSimulation simulation_;
  bus::Bus bus_;
  bus::Bus hands_;
  std::unique_ptr<StateLog> log_;
  torquer_lcm::wire_state_t state_{};
  torquer_lcm::devices_t devices_{};
  torquer_lcm::scene_description_t description_{};
  std::atomic<bool> stop_{false};
  simulator::LiveStatistics statistics_;
  std::thread thread_;
};

}  // namespace torquer::test
