// uinput_hand creates an ordinary mouse and joystick through the kernel's uinput. Lines of text
// move them:
//
//   mouse X Y         counts, in steps of at most 5, one report each
//   button left|right|middle DOWN
//   stick X Y         -1 to 1
//
// Prints "mouse NODE" and "joystick NODE" first, and "ok" after each line.
#include <libevdev/libevdev-uinput.h>
#include <libevdev/libevdev.h>
#include <unistd.h>

#include <algorithm>
#include <cmath>
#include <iostream>
#include <map>
#include <sstream>
#include <stdexcept>
#include <string>

namespace {

constexpr int kLargestStep = 5;
constexpr int kStickEnd = 32767;
constexpr unsigned kStepUs = 1000;

class Device {
 public:
  explicit Device(const char* name) : device_(libevdev_new()) {
    libevdev_set_name(device_, name);
    libevdev_set_id_bustype(device_, BUS_USB);
    libevdev_set_id_vendor(device_, 0x1209);
    libevdev_set_id_product(device_, 0x0003);
  }
  ~Device() {
    if (made_) libevdev_uinput_destroy(made_);
    libevdev_free(device_);
  }
  Device(const Device&) = delete;
  Device& operator=(const Device&) = delete;

  void Has(unsigned type, unsigned code, const input_absinfo* range = nullptr) {
    libevdev_enable_event_code(device_, type, code, range);
  }
  std::string Make() {
    if (libevdev_uinput_create_from_device(device_, LIBEVDEV_UINPUT_OPEN_MANAGED, &made_) != 0) {
      throw std::runtime_error("there is no uinput here");
    }
    return libevdev_uinput_get_devnode(made_);
  }
  void Say(unsigned type, unsigned code, int value) {
    libevdev_uinput_write_event(made_, type, code, value);
  }
  void Done() { Say(EV_SYN, SYN_REPORT, 0); }

 private:
  libevdev* device_;
  libevdev_uinput* made_ = nullptr;
};

// Moves `left` towards 0 by at most one step; returns the step.
int Take(int& left) {
  const int step = std::clamp(left, -kLargestStep, kLargestStep);
  left -= step;
  return step;
}

}  // namespace

int main() {
  const std::map<std::string, unsigned> buttons{
      {"left", BTN_LEFT}, {"right", BTN_RIGHT}, {"middle", BTN_MIDDLE}};
  Device mouse("Guest mouse");
  mouse.Has(EV_REL, REL_X);
  mouse.Has(EV_REL, REL_Y);
  for (const auto& [name, code] : buttons) mouse.Has(EV_KEY, code);
  Device stick("Guest joystick");
  input_absinfo range{};
  range.minimum = -kStickEnd;
  range.maximum = kStickEnd;
  stick.Has(EV_ABS, ABS_X, &range);
  stick.Has(EV_ABS, ABS_Y, &range);
  stick.Has(EV_KEY, BTN_TRIGGER);
  std::cout << "mouse " << mouse.Make() << "\njoystick " << stick.Make() << std::endl;
  for (std::string line; std::getline(std::cin, line);) {
    std::istringstream words(line);
    std::string command;
    words >> command;
    if (command == "mouse") {
      int x = 0, y = 0;
      words >> x >> y;
      while (x != 0 || y != 0) {
        mouse.Say(EV_REL, REL_X, Take(x));
        mouse.Say(EV_REL, REL_Y, Take(y));
        mouse.Done();
        usleep(kStepUs);
      }
    } else if (command == "button") {
      std::string name;
      int down = 0;
      words >> name >> down;
      mouse.Say(EV_KEY, buttons.at(name), down);
      mouse.Done();
    } else if (command == "stick") {
      double x = 0, y = 0;
      words >> x >> y;
      stick.Say(EV_ABS, ABS_X, static_cast<int>(std::lround(x * kStickEnd)));
      stick.Say(EV_ABS, ABS_Y, static_cast<int>(std::lround(y * kStickEnd)));
      stick.Done();
    } else {
      std::cerr << "uinput_hand: cannot do '" << line << "'\n";
      return 2;
    }
    std::cout << "ok" << std::endl;
  }
}
