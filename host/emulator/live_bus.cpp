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
  HandState hand = to_;
  for (const auto coordinate :
       {&HandState::insertion_mm, &HandState::rotation_rad, &HandState::joystick_x,
        &HandState::joystick_y, &HandState::catheter_insertion_mm,
        &HandState::catheter_rotation_rad}) {
    hand.*coordinate = between(from_.*coordinate, to_.*coordinate);
  }
  return hand;
}

LiveBus::LiveBus(const std::string& url) : bus_(url), health_(bus_, "emulator") {
  bus_.Subscribe<torquer_lcm::hand_motion_t>(
      protocol::kHandMotionChannel, [this](const torquer_lcm::hand_motion_t& motion) {
        const bool catheter = motion.device == protocol::SecondSerial(serial_);
        if (!motion.device.empty() && motion.device != serial_ && !catheter) return;
        if (!IsValid(motion)) {
          ++refused_;
        } else if (hand_) {
          HandState target = hand_->target();
          if (catheter) {
            target.catheter_insertion_mm = motion.insertion_mm;
            target.catheter_rotation_rad = motion.rotation_rad;
          } else {
            target.insertion_mm = motion.insertion_mm;
            target.rotation_rad = motion.rotation_rad;
            target.joystick_x = motion.joystick_x;
            target.joystick_y = motion.joystick_y;
            target.buttons = static_cast<std::uint8_t>(motion.buttons);
          }
          hand_->Set(time_s_, target);
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
                           const Sent& sent) {
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
  truth.reports_sent = sent.wire;
  truth.axial_counts = device.sensor().axial_counts();
  truth.transverse_counts = device.sensor().transverse_counts();
  bus_.Publish(protocol::kEmulatorTruthChannel, truth);
  if (device.second_sensor() == nullptr) return;
  truth.device = protocol::SecondSerial(serial_);
  truth.insertion_mm = hand.catheter_insertion_mm;
  truth.rotation_rad = hand.catheter_rotation_rad;
  truth.reports_sent = sent.catheter;
  truth.axial_counts = device.second_sensor()->axial_counts();
  truth.transverse_counts = device.second_sensor()->transverse_counts();
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
