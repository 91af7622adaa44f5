#include "tests/support/evdev_testbed.h"

#include <fcntl.h>
#include <sys/ioctl.h>
#include <umockdev.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <cstring>
#include <filesystem>
#include <mutex>
#include <stdexcept>

#include "host/emulator/umockdev_handler.h"
#include "host/emulator/umockdev_machine.h"

namespace torquer::test {
namespace {

std::string SysPath(int number) {
  return "/devices/virtual/input/input" + std::to_string(number) + "/event" +
         std::to_string(number);
}
std::string NodePath(int number) { return "/dev/input/event" + std::to_string(number); }

std::string LinkPath(const EvdevScript& script) {
  std::string name = script.name;
  std::replace(name.begin(), name.end(), ' ', '_');
  return "/dev/input/by-id/" + name;
}

void SetBit(std::vector<std::uint8_t>& bits, unsigned index) {
  if (index / 8 < bits.size()) bits[index / 8] |= static_cast<std::uint8_t>(1u << (index % 8));
}

void Check(GError* error, const char* what) {
  if (error == nullptr) return;
  const std::string message = std::string(what) + ": " + error->message;
  g_error_free(error);
  throw std::runtime_error(message);
}

template <class Value>
void Store(std::vector<std::uint8_t>& bytes, const Value& value) {
  std::memcpy(bytes.data(), &value, std::min(bytes.size(), sizeof value));
}

}  // namespace

struct EvdevTestbed::Device {
  explicit Device(const EvdevScript& device_script) : script(device_script) {}

  bool Ioctl(UMockdevIoctlClient* client) {
    const unsigned long request = umockdev_ioctl_client_get_request(client);
    if (_IOC_TYPE(request) != 'E') return false;
    const std::lock_guard lock(mutex);
    UMockdevIoctlData* argument = umockdev_ioctl_client_get_arg(client);
    if (_IOC_DIR(request) == _IOC_WRITE) {
      umockdev_ioctl_client_complete(client, Set(request, argument) ? 0 : -1, EBUSY);
      return true;
    }
    std::vector<std::uint8_t> answer(_IOC_SIZE(request));
    const int result = Get(_IOC_NR(request), answer);
    if (result < 0) {
      umockdev_ioctl_client_complete(client, -1, ENOENT);
      return true;
    }
    UMockdevIoctlData* data = umockdev_ioctl_data_resolve(argument, 0, answer.size(), nullptr);
    if (data == nullptr) {  // a client killed during its call
      umockdev_ioctl_client_complete(client, -1, EFAULT);
      return true;
    }
    std::copy(answer.begin(), answer.end(), data->data);
    g_object_unref(data);
    umockdev_ioctl_client_complete(client, result, 0);
    return true;
  }

  // Requests that pass a value to the device; false if refused.
  bool Set(unsigned long request, UMockdevIoctlData* argument) {
    if (request == EVIOCGRAB) {
      // The argument is the value itself, not a pointer.
      grabbed = !script.refuses_grab;
      return grabbed;
    }
    if (request == EVIOCSCLOCKID) {
      UMockdevIoctlData* data = umockdev_ioctl_data_resolve(argument, 0, sizeof(int), nullptr);
      if (data == nullptr) return false;
      std::memcpy(&clock_id, data->data, sizeof clock_id);
      g_object_unref(data);
    }
    return true;
  }

  int Get(unsigned number, std::vector<std::uint8_t>& answer) {
    if (number == _IOC_NR(EVIOCGVERSION)) {
      Store(answer, EV_VERSION);
    } else if (number == _IOC_NR(EVIOCGID)) {
      Store(answer, input_id{BUS_USB, script.vendor_id, script.product_id, 1});
    } else if (number == _IOC_NR(EVIOCGNAME(0))) {
      std::copy_n(script.name.begin(), std::min(script.name.size(), answer.size()), answer.begin());
      return static_cast<int>(script.name.size() + 1);
    } else if (number == _IOC_NR(EVIOCGPHYS(0)) || number == _IOC_NR(EVIOCGUNIQ(0))) {
      return -1;
    } else if (number == _IOC_NR(EVIOCGKEY(0))) {
      for (const unsigned key : keys_down) SetBit(answer, key);
      return static_cast<int>(answer.size());
    } else if (number >= 0x20 && number < 0x40) {
      Capabilities(number - 0x20, answer);
      return static_cast<int>(answer.size());
    } else if (number >= 0x40 && number < 0x80) {
      const auto axis = script.absolute_axes.find(number - 0x40);
      if (axis != script.absolute_axes.end()) Store(answer, axis->second);
    } else {
      return static_cast<int>(answer.size());  // LEDs, switches, properties: none
    }
    return 0;
  }

  void Capabilities(unsigned type, std::vector<std::uint8_t>& bits) const {
    if (type == 0) {
      SetBit(bits, EV_SYN);
      if (!script.keys.empty()) SetBit(bits, EV_KEY);
      if (!script.relative_axes.empty()) SetBit(bits, EV_REL);
      if (!script.absolute_axes.empty()) SetBit(bits, EV_ABS);
    }
    if (type == EV_KEY) {
      for (const unsigned key : script.keys) SetBit(bits, key);
    }
    if (type == EV_REL) {
      for (const unsigned axis : script.relative_axes) SetBit(bits, axis);
    }
    if (type == EV_ABS) {
      for (const auto& [axis, range] : script.absolute_axes) SetBit(bits, axis);
    }
  }

  EvdevScript script;
  std::mutex mutex;
  std::vector<unsigned> keys_down;
  bool grabbed = false;
  int clock_id = -1;
};

struct EvdevTestbed::State {
  UMockdevTestbed* testbed = nullptr;
  std::map<int, std::shared_ptr<Device>> plugged;
};

EvdevTestbed::EvdevTestbed() : state_(std::make_unique<State>()) {
  state_->testbed = emulator::NewMockedMachine();
}

EvdevTestbed::~EvdevTestbed() {
  for (const auto& [number, device] : state_->plugged) {
    umockdev_testbed_detach_ioctl(state_->testbed, LinkPath(device->script).c_str(), nullptr);
  }
  g_object_unref(state_->testbed);
}

std::filesystem::path EvdevTestbed::Root() const {
  char* root = umockdev_testbed_get_root_dir(state_->testbed);
  std::filesystem::path path = root;
  g_free(root);
  return path;
}

std::string EvdevTestbed::Plug(int number, const EvdevScript& script) {
  const auto device = std::make_shared<Device>(script);
  state_->plugged[number] = device;
  const std::string minor = std::to_string(64 + number);
  const std::string description =
      "P: " + SysPath(number) + "\nN: input/event" + std::to_string(number) +
      "\nE: SUBSYSTEM=input\nE: DEVNAME=" + NodePath(number) + "\nE: MAJOR=13\nE: MINOR=" + minor +
      "\nE: ID_INPUT=1\nA: dev=13:" + minor + "\\n\n";
  GError* error = nullptr;
  umockdev_testbed_add_from_string(state_->testbed, description.c_str(), &error);
  Check(error, "add_from_string");
  std::string link = LinkPath(script);
  emulator::AttachIoctls(state_->testbed, link, device);
  const std::filesystem::path place = Root() / link.substr(1);
  std::filesystem::create_directories(place.parent_path());
  std::filesystem::create_symlink("../event" + std::to_string(number), place);
  return link;
}

void EvdevTestbed::Unplug(int number) {
  // The reader's end hangs up only when ours closes, but umockdev keeps ours: this replaces it.
  const int fd = umockdev_testbed_get_dev_fd(state_->testbed, NodePath(number).c_str());
  const int nothing = open("/dev/null", O_RDWR | O_CLOEXEC);
  dup2(nothing, fd);
  close(nothing);
  const std::string link = LinkPath(state_->plugged.at(number)->script);
  std::filesystem::remove(Root() / link.substr(1));
  umockdev_testbed_detach_ioctl(state_->testbed, link.c_str(), nullptr);
  umockdev_testbed_remove_device(state_->testbed, ("/sys" + SysPath(number)).c_str());
  state_->plugged.erase(number);

  // umockdev leaves a map entry from terminal to device, which would block the next device.
  const std::string own = "13:" + std::to_string(64 + number) + "\n";
  std::error_code ignored;
  for (const auto& entry : std::filesystem::directory_iterator(Root() / "dev/.ptymap", ignored)) {
    if (std::filesystem::read_symlink(entry.path(), ignored) == own) {
      std::filesystem::remove(entry.path(), ignored);
      break;
    }
  }
}

void EvdevTestbed::Send(int number, const std::vector<Event>& events, std::int64_t time_us) {
  std::vector<input_event> sent;
  for (const Event& event : events) {
    input_event raw{};
    raw.input_event_sec = static_cast<decltype(raw.input_event_sec)>(time_us / 1000000);
    raw.input_event_usec = static_cast<decltype(raw.input_event_usec)>(time_us % 1000000);
    raw.type = static_cast<std::uint16_t>(event.type);
    raw.code = static_cast<std::uint16_t>(event.code);
    raw.value = event.value;
    sent.push_back(raw);
  }
  input_event end{};
  end.input_event_sec = static_cast<decltype(end.input_event_sec)>(time_us / 1000000);
  end.input_event_usec = static_cast<decltype(end.input_event_usec)>(time_us % 1000000);
  end.type = EV_SYN;
  end.code = SYN_REPORT;
  sent.push_back(end);
  const int fd = umockdev_testbed_get_dev_fd(state_->testbed, NodePath(number).c_str());
  const std::size_t size = sent.size() * sizeof(input_event);
  if (write(fd, sent.data(), size) != static_cast<ssize_t>(size)) {
    throw std::runtime_error("cannot send events to " + NodePath(number));
  }
}

void EvdevTestbed::SendDropped(int number, std::int64_t time_us) {
  Send(number, {{EV_SYN, SYN_DROPPED, 0}}, time_us);
}

void EvdevTestbed::SetKeyState(int number, unsigned key, bool down) {
  Device& device = *state_->plugged.at(number);
  const std::lock_guard lock(device.mutex);
  std::erase(device.keys_down, key);
  if (down) device.keys_down.push_back(key);
}

bool EvdevTestbed::Grabbed(int number) const {
  Device& device = *state_->plugged.at(number);
  const std::lock_guard lock(device.mutex);
  return device.grabbed;
}

int EvdevTestbed::ClockId(int number) const {
  Device& device = *state_->plugged.at(number);
  const std::lock_guard lock(device.mutex);
  return device.clock_id;
}

}  // namespace torquer::test
