#include "host/recorder/course_feed.h"

#include <utility>

namespace torquer {

void CourseFeed::AddState(std::int64_t now_us) {
  simulation_.now().Describe(state_);
  state_.clock_id = clock_id_;
  state_.publish_us = now_us;
  course_.Add(state_);
  readings_.names.clear();
  readings_.values.clear();
  readings_.tick = state_.tick;
  readings_.time_s = state_.time_s;
  for (effects::Reading& reading : simulation_.now().Readings()) {
    readings_.names.push_back(std::move(reading.name));
    readings_.values.push_back(reading.value);
  }
  readings_.count = static_cast<std::int32_t>(readings_.names.size());
  course_.Add(readings_);
}

void CourseFeed::AddPedals(std::int64_t now_us, bool xray, bool contrast) {
  torquer_lcm::instrument_command_t command{};
  command.instrument = state_.instruments.front().name;
  command.clock_id = clock_id_;
  command.publish_us = now_us;
  command.xray = xray ? 1 : 0;
  command.contrast = contrast ? 1 : 0;
  course_.Add(command);
}

}  // namespace torquer
