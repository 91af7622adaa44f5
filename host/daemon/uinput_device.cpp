#include "host/daemon/uinput_device.h"

#include <fmt/format.h>
#include <libevdev/libevdev-uinput.h>
#include <libevdev/libevdev.h>

#include <cmath>
#include <cstring>
#include <initializer_list>

#include "host/support/error.h"
#include "protocol/hid_reports.h"
#include "protocol/lcm_channels.h"

namespace torquer::daemon {

std::vector<BoxEvent> BoxEvents::Of(const HandState& hand) {
  State now;
  now.start = hand.start;
  now.insertion = std::llround(hand.pose.insertion_mm / kUinputMm);
  now.rotation = std::llround(hand.pose.rotation_rad / kUinputRad);
  now.stick_x = hand.joystick_x;
  now.stick_y = hand.joystick_y;
  now.xray = hand.xray;
  now.contrast = hand.contrast;
  now.clutch = (hand.flags & protocol::kCommandClutch) != 0;
  State last = last_.value_or(State{});
  if (!last_ || last.start != now.start) {
    last.insertion = now.insertion;
    last.rotation = now.rotation;
  }

  std::vector<BoxEvent> events;
  const auto tell = [&](unsigned type, unsigned code, bool changed, std::int64_t value) {
    if (changed) events.push_back({type, code, static_cast<int>(value)});
  };
  const std::int64_t pushed = now.insertion - last.insertion;
  const std::int64_t turned = now.rotation - last.rotation;
  tell(EV_REL, REL_Z, pushed != 0, pushed);
  tell(EV_REL, REL_RZ, turned != 0, turned);
  tell(EV_ABS, ABS_X, !last_ || now.stick_x != last.stick_x, now.stick_x);
  tell(EV_ABS, ABS_Y, !last_ || now.stick_y != last.stick_y, now.stick_y);
  tell(EV_KEY, BTN_TRIGGER, now.xray != last.xray, now.xray);
  tell(EV_KEY, BTN_THUMB, now.contrast != last.contrast, now.contrast);
  tell(EV_KEY, BTN_THUMB2, now.clutch != last.clutch, now.clutch);
  if (!events.empty()) events.push_back({EV_SYN, SYN_REPORT, 0});
  last_ = now;
  return events;
}

struct UinputDevice::Handle {
  libevdev_uinput* device = nullptr;
};

UinputDevice::UinputDevice(const std::string& name) : handle_(std::make_unique<Handle>()) {
  libevdev* const description = libevdev_new();
  libevdev_set_name(description, name.c_str());
  libevdev_set_id_bustype(description, BUS_VIRTUAL);
  // No REL_X and REL_Y: with them the desktop would treat the device as a mouse and move the
  // pointer.
  for (const unsigned axis : {REL_Z, REL_RZ}) {
    libevdev_enable_event_code(description, EV_REL, axis, nullptr);
  }
  input_absinfo range{};
  range.value = (protocol::kJoystickMax + 1) / 2;
  range.maximum = protocol::kJoystickMax;
  for (const unsigned axis : {ABS_X, ABS_Y}) {
    libevdev_enable_event_code(description, EV_ABS, axis, &range);
  }
  for (const unsigned button : {BTN_TRIGGER, BTN_THUMB, BTN_THUMB2}) {
    libevdev_enable_event_code(description, EV_KEY, button, nullptr);
  }
  const int error = libevdev_uinput_create_from_device(description, LIBEVDEV_UINPUT_OPEN_MANAGED,
                                                       &handle_->device);
  libevdev_free(description);
  if (error != 0) {
    throw UserError(fmt::format(
        "--uinput: /dev/uinput cannot be used ({}); load the module (sudo modprobe uinput) and "
        "give this user access to the file (see host/daemon/README.md), or leave out --uinput",
        std::strerror(-error)));
  }
}

UinputDevice::~UinputDevice() { libevdev_uinput_destroy(handle_->device); }

void UinputDevice::Show(const HandState& hand) {
  for (const BoxEvent& event : events_.Of(hand)) {
    libevdev_uinput_write_event(handle_->device, event.type, event.code, event.value);
  }
}

std::string UinputDevice::path() const {
  const char* const path = libevdev_uinput_get_devnode(handle_->device);
  return path == nullptr ? "" : path;
}

}  // namespace torquer::daemon
