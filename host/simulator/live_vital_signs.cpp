#include "host/simulator/live_vital_signs.h"

#include "host/bus/clock.h"
#include "protocol/lcm_channels.h"

namespace torquer::simulator {

using effects::VitalSigns;

static_assert(int{protocol::kAlarmRateLow} == int{effects::kRateLow} &&
              int{protocol::kAlarmRateHigh} == int{effects::kRateHigh} &&
              int{protocol::kAlarmSystolicLow} == int{effects::kSystolicLow} &&
              int{protocol::kAlarmSystolicHigh} == int{effects::kSystolicHigh} &&
              int{protocol::kAlarmPressureDamped} == int{effects::kPressureDamped});

void DescribeVitalSigns(const Simulation& simulation, torquer_lcm::vital_signs_t& out) {
  const VitalSigns& vitals = *simulation.vitals();
  out.tick = simulation.tick();
  out.time_s = simulation.time_s();
  out.clock_id = bus::ClockId();
  out.heart_rate_per_min = vitals.rate_per_min;
  out.beat_s = vitals.beat_s;
  out.systolic_mmHg = vitals.systolic_mmHg;
  out.diastolic_mmHg = vitals.diastolic_mmHg;
  out.mean_mmHg = vitals.mean_mmHg;
  out.wedged = vitals.wedged ? 1 : 0;
  out.alarms = vitals.alarms;
  out.rate_limits_per_min[0] = vitals.limits.rate_low_per_min;
  out.rate_limits_per_min[1] = vitals.limits.rate_high_per_min;
  out.systolic_limits_mmHg[0] = vitals.limits.systolic_low_mmHg;
  out.systolic_limits_mmHg[1] = vitals.limits.systolic_high_mmHg;
  out.sample_s = VitalSigns::kSampleS;
  out.first_sample = vitals.first();
  out.ecg.clear();
  out.pressure_mmHg.clear();
  for (std::int64_t n = vitals.first(); n < vitals.samples; ++n) {
    out.ecg.push_back(vitals.at(n).ecg);
    out.pressure_mmHg.push_back(vitals.at(n).pressure_mmHg);
  }
  out.sample_count = static_cast<std::int32_t>(out.ecg.size());
}

void LiveVitalSigns::PublishWhenDue(std::int64_t now_us) {
  if (simulation_.now().vitals() == nullptr) return;
  if (now_us - message_.publish_us < kVitalSignsEveryUs) return;
  DescribeVitalSigns(simulation_.now(), message_);
  message_.publish_us = bus::MonotonicUs();
  bus_.Publish(protocol::kVitalSignsChannel, message_);
}

}  // namespace torquer::simulator
