#include "host/daemon/table_commands.h"

#include "host/bus/clock.h"
#include "protocol/lcm_channels.h"

namespace torquer::daemon {

const torquer_lcm::table_command_t* TableCommands::Next(const TablePlace& place,
                                                        std::int64_t now_us,
                                                        const std::string& instrument) {
  const bool moves = place != sent_;
  moved_ = moved_ || moves;
  if (!moved_ || now_us - command_.publish_us < (moves ? kIntervalUs : kRepeatUs)) return nullptr;
  sent_ = place;
  command_.instrument = instrument;
  command_.sequence = protocol::NextSequence(command_.sequence);
  command_.clock_id = bus::ClockId();
  command_.publish_us = now_us;
  command_.left_mm = place.left_mm;
  command_.head_mm = place.head_mm;
  command_.height_mm = place.height_mm;
  return &command_;
}

void TableCommands::Publish(const TablePlace& place, std::int64_t now_us,
                            const std::string& instrument, bus::Bus& bus) {
  const torquer_lcm::table_command_t* const command = Next(place, now_us, instrument);
  if (command != nullptr) bus.Publish(protocol::kTableCommandChannel, *command);
}

}  // namespace torquer::daemon
