// Joystick step of the guided calibration.
#include <fmt/format.h>

#include <cmath>

#include "calibration/procedure.h"
#include "host/support/error.h"

namespace torquer::calibration {
namespace {

// Counts within which a released joystick lies still, and around the first rest.
constexpr double kStickStill = 10.0;
constexpr double kStickNearRest = 100.0;

}  // namespace

void Procedure::Joystick(const Reading& reading) {
  if (!rest_checked_ && releases_ == 0 && stick_moved_[0].empty()) {
    rest_joystick_x_ = reading.joystick_x;
    rest_joystick_y_ = reading.joystick_y;
  }
  stick_moved_[0].push_back(reading.joystick_x);
  stick_moved_[1].push_back(reading.joystick_y);
  const auto near_rest = [&](const Reading& at) {
    return std::abs(at.joystick_x - rest_joystick_x_) < kStickNearRest &&
           std::abs(at.joystick_y - rest_joystick_y_) < kStickNearRest;
  };
  if (!near_rest(reading)) {
    stick_away_ = true;
    return;
  }
  if (recent_.back().time_us - recent_.front().time_us < kStillUs) return;
  for (const Reading& earlier : recent_) {
    if (std::abs(earlier.joystick_x - reading.joystick_x) > kStickStill ||
        std::abs(earlier.joystick_y - reading.joystick_y) > kStickStill) {
      return;
    }
  }
  stick_at_rest_[0].push_back(reading.joystick_x);
  stick_at_rest_[1].push_back(reading.joystick_y);
  if (!stick_away_) return;
  stick_away_ = false;
  if (++releases_ >= kStickReleases) EndJoystick();
}

void Procedure::EndJoystick() {
  const double full_rate = JoystickAxis{}.full_rate_rad_per_s;
  try {
    axes_ = {FitJoystickAxis(stick_at_rest_[0], stick_moved_[0], full_rate),
             FitJoystickAxis(stick_at_rest_[1], stick_moved_[1], full_rate)};
  } catch (const UserError& error) {
    return Say(Message::Kind::kRejected, error.what());
  }
  for (std::size_t i = 0; i < 2; ++i) {
    const JoystickAxis& axis = (*axes_)[i];
    Say(Message::Kind::kAccepted, (i == 0 ? "joystick left to right: " : "joystick near to far: ") +
                                      fmt::format("rests at {:.0f}, from {:.0f} to {:.0f}",
                                                  axis.center, axis.minimum, axis.maximum));
  }
  GoOn();
}

}  // namespace torquer::calibration
