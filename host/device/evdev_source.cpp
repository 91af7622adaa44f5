#include "host/device/evdev_source.h"

#include <fcntl.h>
#include <fmt/format.h>
#include <poll.h>
#include <sys/timerfd.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <cmath>
#include <cstring>
#include <filesystem>

#include "host/bus/clock.h"
#include "host/support/error.h"

namespace torquer::device {
namespace {

constexpr int kReconnectMs = 100;
constexpr std::int64_t kIntervalUs = 1000;
constexpr std::uint16_t kMiddle = 512;

bool IsMouse(const libevdev* device) {
  return libevdev_has_event_code(device, EV_REL, REL_X) != 0 &&
         libevdev_has_event_code(device, EV_REL, REL_Y) != 0;
}

bool IsJoystick(const libevdev* device) {
  // Touchpads and tablets have these axes too, but also these keys.
  return libevdev_has_event_code(device, EV_ABS, ABS_X) != 0 &&
         libevdev_has_event_code(device, EV_ABS, ABS_Y) != 0 &&
         libevdev_has_event_code(device, EV_KEY, BTN_TOUCH) == 0 &&
         libevdev_has_event_code(device, EV_KEY, BTN_TOOL_PEN) == 0;
}

// The device's own number, or its model.
std::string SerialOf(const libevdev* device) {
  const char* unique = libevdev_get_uniq(device);
  std::string serial = unique != nullptr && *unique != '\0'
                           ? unique
                           : fmt::format("{:04x}:{:04x}", libevdev_get_id_vendor(device),
                                         libevdev_get_id_product(device));
  serial.resize(std::min(serial.size(), sizeof(protocol::IdentityReport::serial)));
  return serial;
}

std::vector<InputListing> InputsIn(const char* folder) {
  std::vector<InputListing> inputs;
  std::error_code error;
  for (const auto& entry : std::filesystem::directory_iterator(folder, error)) {
    const std::string path = entry.path().string();
    const int fd = open(path.c_str(), O_RDONLY | O_NONBLOCK | O_CLOEXEC);
    if (fd < 0) continue;
    libevdev* device = nullptr;
    if (libevdev_new_from_fd(fd, &device) == 0) {
      if (IsMouse(device) || IsJoystick(device)) {
        inputs.push_back({path, libevdev_get_name(device), SerialOf(device), IsMouse(device)});
      }
      libevdev_free(device);
    }
    close(fd);
  }
  std::sort(inputs.begin(), inputs.end(),
            [](const InputListing& a, const InputListing& b) { return a.path < b.path; });
  return inputs;
}

// The mice that this user may read, for messages.
std::string MiceHere() {
  std::string mice;
  for (const InputListing& input : InputsHere()) {
    if (input.is_mouse) mice += fmt::format("\n  --device {}  ({})", input.path, input.name);
  }
  return mice.empty() ? "none that this user may read" : mice;
}

std::uint8_t ButtonOf(std::uint16_t code) {
  switch (code) {
    case BTN_LEFT:
    case BTN_TRIGGER:
    case BTN_SOUTH:
      return protocol::kButtonXray;
    case BTN_RIGHT:
    case BTN_THUMB:
    case BTN_EAST:
      return protocol::kButtonContrast;
    case BTN_MIDDLE:
    case BTN_THUMB2:
    case BTN_NORTH:
      return protocol::kButtonClutch;
    case BTN_SIDE:
    case BTN_TOP:
    case BTN_WEST:
      return protocol::kButtonStick;
    default:
      return 0;
  }
}

std::int64_t TimeUs(const input_event& event) {
  return static_cast<std::int64_t>(event.input_event_sec) * 1000000 + event.input_event_usec;
}

std::int32_t Sum(std::int32_t count, std::int32_t step) {  // wraps, as the device's counters do
  return static_cast<std::int32_t>(static_cast<std::uint32_t>(count) +
                                   static_cast<std::uint32_t>(step));
}

}  // namespace

std::vector<InputListing> InputsHere() {
  std::vector<InputListing> inputs = InputsIn("/dev/input/by-id");
  return inputs.empty() ? InputsIn("/dev/input") : inputs;
}

// One open device file.
struct EvdevSource::Input {
  Input(int file, libevdev* made) : fd(file), device(made), is_mouse(IsMouse(made)) {}
  ~Input() {
    libevdev_free(device);  // ends the grab
    close(fd);
  }
  Input(const Input&) = delete;
  Input& operator=(const Input&) = delete;

  // An axis reading on the scale of the bench device's joystick.
  std::uint16_t Scaled(unsigned code, int value, bool turned) const {
    const double low = libevdev_get_abs_minimum(device, code);
    const double high = libevdev_get_abs_maximum(device, code);
    if (!(high > low)) return kMiddle;
    double fraction = std::clamp((value - low) / (high - low), 0.0, 1.0);
    if (turned) fraction = 1.0 - fraction;
    return static_cast<std::uint16_t>(std::lround(fraction * protocol::kJoystickMax));
  }

  int fd;
  libevdev* device;
  bool is_mouse;
  std::uint8_t buttons = 0;
};

EvdevSource::EvdevSource(std::vector<std::string> paths) : paths_(std::move(paths)) {
  if (paths_.empty() || paths_.size() > 2) {
    throw UserError(fmt::format(
        "--source evdev needs a mouse and may have a joystick: give --device once or twice. Mice "
        "here: {}",
        MiceHere()));
  }
  timer_ = timerfd_create(CLOCK_MONOTONIC, TFD_CLOEXEC | TFD_NONBLOCK);
  const itimerspec interval{{0, kIntervalUs * 1000}, {0, kIntervalUs * 1000}};
  timerfd_settime(timer_, 0, &interval, nullptr);
  report_.report_id = protocol::kInputReportId;
  report_.protocol_version = protocol::kProtocolVersion;
  report_.surface_quality = 255;
  report_.cpi = kNominalMouseCpi;
}

EvdevSource::~EvdevSource() {
  Close();
  close(timer_);
}

std::string EvdevSource::place() const {
  std::string place = "input devices";
  for (const std::string& path : paths_) place += " " + path;
  return place;
}

// True if all are open. Missing devices are tried again later.
bool EvdevSource::Open() {
  for (const std::string& path : paths_) {
    const int fd = open(path.c_str(), O_RDONLY | O_NONBLOCK | O_CLOEXEC);
    if (fd < 0 && (errno == EACCES || errno == EPERM)) {
      throw UserError(fmt::format(
          "{} may not be read by this user; join the group that may: sudo usermod -aG input $USER, "
          "and log in again",
          path));
    }
    if (fd < 0) {
      Close();
      return false;
    }
    libevdev* device = nullptr;
    const int error = libevdev_new_from_fd(fd, &device);
    if (error != 0) {
      close(fd);
      throw UserError(fmt::format("{} is not an input device ({}); give one of /dev/input/event*",
                                  path, std::strerror(-error)));
    }
    inputs_.push_back(std::make_unique<Input>(fd, device));
    if (!IsMouse(device) && !IsJoystick(device)) {
      throw UserError(fmt::format("{} ({}) is neither a mouse nor a joystick. Mice here: {}", path,
                                  libevdev_get_name(device), MiceHere()));
    }
    if (libevdev_grab(device, LIBEVDEV_GRAB) != 0) {
      throw UserError(fmt::format("{} ({}) is grabbed by another program; stop that one first",
                                  path, libevdev_get_name(device)));
    }
    libevdev_set_clock_id(device, CLOCK_MONOTONIC);
  }
  const auto mice = std::count_if(inputs_.begin(), inputs_.end(),
                                  [](const auto& input) { return input->is_mouse; });
  if (mice != 1) {
    throw UserError(fmt::format(
        "of the devices given with --device {} are mice; give one mouse, and at most one joystick. "
        "Mice here: {}",
        mice, MiceHere()));
  }
  std::sort(inputs_.begin(), inputs_.end(),
            [](const auto& a, const auto& b) { return a->is_mouse && !b->is_mouse; });

  serial_ = SerialOf(inputs_.front()->device);
  ++report_.boot_id;
  report_.buttons = 0;
  report_.joystick_x = kMiddle;
  report_.joystick_y = kMiddle;
  if (inputs_.size() == 2) {
    const Input& stick = *inputs_[1];
    report_.joystick_x =
        stick.Scaled(ABS_X, libevdev_get_event_value(stick.device, EV_ABS, ABS_X), false);
    report_.joystick_y =
        stick.Scaled(ABS_Y, libevdev_get_event_value(stick.device, EV_ABS, ABS_Y), true);
  }
  gone_.clear();
  return true;
}

void EvdevSource::Close() { inputs_.clear(); }

void EvdevSource::Wait(int timeout_ms, const Sink& sink) {
  const auto open = [this] {
    try {
      return Open();
    } catch (...) {
      Close();
      throw;
    }
  };
  if (inputs_.empty() && reopening_.Try(open, sink)) {
    sink({.kind = SourceEvent::Kind::kConnected,
          .host_us = bus::MonotonicUs(),
          .report = {},
          .text = place()});
  }
  std::vector<pollfd> events{{wake_up_.fd(), POLLIN, 0}};
  if (!inputs_.empty()) events.push_back({timer_, POLLIN, 0});
  for (const auto& input : inputs_) events.push_back({input->fd, POLLIN, 0});
  if (inputs_.empty()) timeout_ms = std::min(timeout_ms, kReconnectMs);
  if (poll(events.data(), events.size(), timeout_ms) <= 0) return;
  if (events[0].revents != 0) wake_up_.Clear();
  if (inputs_.empty()) return;

  std::uint64_t ticks = 0;
  [[maybe_unused]] const ssize_t taken = read(timer_, &ticks, sizeof ticks);
  // Reads the joystick first, so that the reports have its newest state.
  std::deque<protocol::InputReport> reports;
  for (auto input = inputs_.rbegin(); input != inputs_.rend(); ++input) ReadAll(**input, reports);
  for (std::size_t i = 0; i < inputs_.size(); ++i) {
    if ((events[2 + i].revents & (POLLHUP | POLLERR)) != 0) NoteGone(*inputs_[i]);
  }
  const std::int64_t now_us = bus::MonotonicUs();
  if (reports.empty() && gone_.empty() && now_us - last_time_us_ >= kIntervalUs) {
    reports.push_back(MakeReport(now_us));
  }
  for (const protocol::InputReport& report : reports) {
    sink({.kind = SourceEvent::Kind::kReport,
          .host_us = now_us,
          .report = {reinterpret_cast<const std::uint8_t*>(&report), sizeof report},
          .text = {}});
  }
  if (!gone_.empty()) {
    Close();
    sink(
        {.kind = SourceEvent::Kind::kDisconnected, .host_us = now_us, .report = {}, .text = gone_});
  }
}

void EvdevSource::LetGo(const std::string& reason) {
  if (inputs_.empty() || !gone_.empty()) return;
  gone_ = reason;
  reopening_.Pause();
}

void EvdevSource::ReadAll(Input& input, std::deque<protocol::InputReport>& reports) {
  unsigned mode = LIBEVDEV_READ_FLAG_NORMAL;
  for (;;) {
    input_event event{};
    const int result = libevdev_next_event(input.device, mode, &event);
    if (result == LIBEVDEV_READ_STATUS_SYNC && mode == LIBEVDEV_READ_FLAG_NORMAL) {
      // The kernel has dropped events. The state of buttons and axes follows. The motion of the
      // mouse is lost. To report this, the source omits a report and marks the next one as
      // doubtful.
      mode = LIBEVDEV_READ_FLAG_SYNC;
      if (input.is_mouse) {
        ++report_.sequence;
        doubtful_ = true;
      }
      continue;
    }
    if (result == -EAGAIN && mode == LIBEVDEV_READ_FLAG_SYNC) {
      mode = LIBEVDEV_READ_FLAG_NORMAL;
      continue;
    }
    if (result == -EAGAIN || result == -EINTR) return;
    if (result < 0) {
      NoteGone(input);
      return;
    }
    Take(input, event, reports);
  }
}

void EvdevSource::NoteGone(const Input& input) {
  gone_ = fmt::format("{} was unplugged", libevdev_get_name(input.device));
}

void EvdevSource::Take(Input& input, const input_event& event,
                       std::deque<protocol::InputReport>& reports) {
  if (event.type == EV_KEY) {
    const std::uint8_t button = ButtonOf(event.code);
    input.buttons = static_cast<std::uint8_t>(event.value != 0 ? input.buttons | button
                                                               : input.buttons & ~button);
    report_.buttons = 0;
    for (const auto& each : inputs_) report_.buttons |= each->buttons;
  } else if (event.type == EV_REL && input.is_mouse && event.code == REL_X) {
    report_.axial_counts = Sum(report_.axial_counts, event.value);
    report_.flags |= protocol::kFlagMotion;
  } else if (event.type == EV_REL && input.is_mouse && event.code == REL_Y) {
    report_.transverse_counts = Sum(report_.transverse_counts, event.value);
    report_.flags |= protocol::kFlagMotion;
  } else if (event.type == EV_ABS && !input.is_mouse && event.code == ABS_X) {
    report_.joystick_x = input.Scaled(ABS_X, event.value, false);
  } else if (event.type == EV_ABS && !input.is_mouse && event.code == ABS_Y) {
    report_.joystick_y = input.Scaled(ABS_Y, event.value, true);
  } else if (event.type == EV_SYN && event.code == SYN_REPORT && input.is_mouse) {
    reports.push_back(MakeReport(TimeUs(event)));
  }
}

protocol::InputReport EvdevSource::MakeReport(std::int64_t time_us) {
  last_time_us_ = std::max(time_us, last_time_us_);
  ++report_.sequence;
  report_.device_time_us = static_cast<std::uint32_t>(last_time_us_);
  protocol::InputReport report = report_;
  if (doubtful_) report.flags |= protocol::kFlagLift;
  doubtful_ = false;
  report_.flags = 0;
  return report;
}

std::vector<std::uint8_t> EvdevSource::GetFeature(std::uint8_t report_id) {
  if (inputs_.empty()) throw DeviceGone("no device is connected");
  std::vector<std::uint8_t> bytes;
  const auto fill = [&](const auto& report) {
    bytes.resize(sizeof report);
    std::memcpy(bytes.data(), &report, sizeof report);
  };
  if (report_id == protocol::kIdentityReportId) {
    protocol::IdentityReport identity{};
    identity.report_id = report_id;
    identity.protocol_version = protocol::kProtocolVersion;
    serial_.copy(identity.serial, sizeof identity.serial);
    fill(identity);
  } else if (report_id == protocol::kConfigurationReportId) {
    protocol::ConfigurationReport configuration{};
    configuration.report_id = report_id;
    configuration.protocol_version = protocol::kProtocolVersion;
    configuration.cpi = kNominalMouseCpi;
    fill(configuration);
  } else {
    throw FeatureError("a mouse has no feature reports");
  }
  return bytes;
}

void EvdevSource::SetFeature(std::span<const std::uint8_t> /*report*/) {
  throw FeatureError("a mouse has no settings");
}

}  // namespace torquer::device
