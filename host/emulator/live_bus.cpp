#include "host/emulator/live_bus.h"

#include <algorithm>
#include <cmath>

#include "host/bus/clock.h"
#include "protocol/lcm_channels.h"
#include "torquer_lcm/hand_motion_t.hpp"

namespace torquer::emulator {
namespace {

constexpr double kLongestGlide_s = 0.05;

bool IsValid(const torquer_lcm::hand_motion_t& motion) {
  return std::isfinite(motion.insertion_mm) && std::isfinite(motion.rotation_rad) &&
         std::abs(motion.joystick_x) <= 1 && std::abs(motion.joystick_y) <= 1;
}

}  // namespace

void LiveHand::Set(double time_s, const HandState& target) {
  from_ = At(time_s);
  from_.buttons = target.buttons;
  to_ = target;
  from_s_ = time_s;
  to_s_ = time_s + std::clamp(time_s - last_s_, 0.0, kLongestGlide_s);
  last_s_ = time_s;
}

HandState LiveHand::At(double time_s) const {
  if (time_s >= to_s_) return to_;
  const double share = std::max(0.0, (time_s - from_s_) / (to_s_ - from_s_));
  const auto between = [share](double from, double to) { return from + share * (to - from); };
  return {between(from_.insertion_mm, to_.insertion_mm),
          between(from_.rotation_rad, to_.rotation_rad), between(from_.joystick_x, to_.joystick_x),
          between(from_.joystick_y, to_.joystick_y), to_.buttons};
}

LiveBus::LiveBus(const std::string& url) : bus_(url), health_(bus_, "emulator") {
  bus_.Subscribe<torquer_lcm::hand_motion_t>(
      protocol::kHandMotionChannel, [this](const torquer_lcm::hand_motion_t& motion) {
        if (!motion.device.empty() && motion.device != serial_) return;  // another box's
        if (!IsValid(motion)) {
          ++refused_;
        } else if (hand_) {
          hand_->Set(time_s_, {motion.insertion_mm, motion.rotation_rad, motion.joystick_x,
                               motion.joystick_y, static_cast<std::uint8_t>(motion.buttons)});
        }
      });
}

void LiveBus::Service(double time_s, LiveHand* hand) {
  hand_ = hand;
  time_s_ = time_s;
  bus_.Handle(0);
  hand_ = nullptr;
}

void LiveBus::PublishTruth(const BenchDevice& device, double time_s, const HandState& hand,
                           std::int64_t reports_sent) {
  torquer_lcm::hand_motion_t truth{};
  truth.device = serial_;
  truth.clock_id = bus::ClockId();
  truth.publish_us = bus::MonotonicUs();
  truth.time_s = time_s;
  truth.insertion_mm = hand.insertion_mm;
  truth.rotation_rad = hand.rotation_rad;
  truth.joystick_x = hand.joystick_x;
  truth.joystick_y = hand.joystick_y;
  truth.buttons = static_cast<std::int8_t>(hand.buttons);
  truth.reports_sent = reports_sent;
  truth.axial_counts = device.sensor().axial_counts();
  truth.transverse_counts = device.sensor().transverse_counts();
  bus_.Publish(protocol::kEmulatorTruthChannel, truth);
}

void LiveBus::PublishHealth(const std::string& state, const std::string& message,
                            const bus::HealthCounters& counters) {
  if (state != health_.state()) {
    health_.Change(state, message, counters);
  } else if (health_.Due(bus::MonotonicUs())) {
    health_.Repeat(counters);
  }
}

}  // namespace torquer::emulator
