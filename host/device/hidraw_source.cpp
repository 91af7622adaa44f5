#include "host/device/hidraw_source.h"

#include <fmt/format.h>
#include <fmt/ranges.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <chrono>
#include <cstring>
#include <thread>
#include <utility>

#include "host/bus/clock.h"
#include "host/device/device_identity.h"
#include "host/device/usb.h"
#include "host/support/error.h"
#include "protocol/hid_reports.h"
#include "protocol/usb_ids.h"

namespace torquer::device {
namespace {

// Longest wait before a check for Interrupt(), because a wait of hidapi cannot be ended.
constexpr int kSliceMs = 10;
constexpr std::int64_t kLookUs = 100000;
constexpr int kBurst = 64;
// Permissions are granted by udev, perhaps a moment after the device is announced.
constexpr std::int64_t kPermissionUs = 3000000;

// Serial number and product are ASCII.
std::string Plain(const wchar_t* text) {
  std::string plain;
  for (; text != nullptr && *text != L'\0'; ++text) {
    plain += *text >= L' ' && *text <= L'~' ? static_cast<char>(*text) : '?';
  }
  return plain;
}

}  // namespace

HidrawSource::HidrawSource(std::string serial) : serial_(std::move(serial)) {
  if (hid_init() != 0) {
    throw UserError("hidapi cannot be used on this machine; try --source usb");
  }
}

HidrawSource::~HidrawSource() {
  if (device_ != nullptr) hid_close(device_);
  hid_exit();
}

std::string HidrawSource::place() const {
  std::string place =
      fmt::format("hidraw ({:04x}:{:04x}{}{})", protocol::kUsbVendorId, protocol::kUsbProductId,
                  serial_.empty() ? "" : ", serial number ", serial_);
  if (bootloader_seen_ && device_ == nullptr) {
    place += fmt::format(", where a device waits in its bootloader: {},", kFlashRemedy);
  }
  return place;
}

// The selected device, if it is connected.
std::optional<HidrawSource::Found> HidrawSource::Look() {
  std::vector<Found> found;
  bootloader_seen_ = false;
  hid_device_info* const list = hid_enumerate(protocol::kUsbVendorId, 0);
  for (const hid_device_info* one = list; one != nullptr; one = one->next) {
    if (one->product_id == protocol::kUsbBootloaderProductId) bootloader_seen_ = true;
    // Prototypes of other makers use the same ids.
    if (one->product_id != protocol::kUsbProductId ||
        Plain(one->product_string) != protocol::kUsbProduct) {
      continue;
    }
    const std::string serial = Plain(one->serial_number);
    if (!serial.empty() && (serial_.empty() || serial == serial_)) {
      found.push_back({one->path, serial});
    }
  }
  hid_free_enumeration(list);
  if (found.empty()) return std::nullopt;
  if (found.size() > 1) {
    std::vector<std::string> serials;
    for (const Found& one : found) serials.push_back(one.serial);
    std::sort(serials.begin(), serials.end());
    throw UserError(
        fmt::format("several bench devices are plugged in: {}; choose one with --device",
                    fmt::join(serials, ", ")));
  }
  return found.front();
}

bool HidrawSource::Open() {
  const std::int64_t now_us = bus::MonotonicUs();
  if (now_us - looked_us_ < kLookUs) return false;
  looked_us_ = now_us;
  const std::optional<Found> found = Look();
  if (!found) return false;
  if (access(found->path.c_str(), R_OK | W_OK) != 0 && errno == EACCES) {
    if (forbidden_us_ == 0) forbidden_us_ = now_us;
    if (now_us - forbidden_us_ < kPermissionUs) return false;
    throw UserError(
        fmt::format("{} may not be opened by this user; {}", found->path, kPermissionRemedy));
  }
  forbidden_us_ = 0;
  device_ = hid_open_path(found->path.c_str());
  if (device_ == nullptr) return false;  // perhaps just unplugged; the search continues
  path_ = found->path;
  serial_ = found->serial;
  gone_.clear();
  return true;
}

void HidrawSource::Wait(int timeout_ms, const Sink& sink) {
  if (device_ == nullptr && reopening_.Try([this] { return Open(); }, sink)) {
    sink({.kind = SourceEvent::Kind::kConnected,
          .host_us = bus::MonotonicUs(),
          .report = {},
          .text = path_});
  }
  const std::int64_t end_us = bus::MonotonicUs() + 1000 * std::int64_t{timeout_ms};
  for (bool done = false; !done && !interrupted_.exchange(false);) {
    const std::int64_t left_ms = (end_us - bus::MonotonicUs() + 999) / 1000;
    const int slice_ms = static_cast<int>(std::clamp<std::int64_t>(left_ms, 0, kSliceMs));
    done = left_ms <= 0;
    if (device_ == nullptr) {
      std::this_thread::sleep_for(std::chrono::milliseconds(slice_ms));
    } else {
      done = Read(slice_ms, sink) || done;
    }
  }
  if (device_ == nullptr || gone_.empty()) return;
  hid_close(device_);
  device_ = nullptr;
  sink({.kind = SourceEvent::Kind::kDisconnected,
        .host_us = bus::MonotonicUs(),
        .report = {},
        .text = path_ + " " + gone_});
}

void HidrawSource::LetGo(const std::string& reason) {
  if (device_ == nullptr || !gone_.empty()) return;
  gone_ = reason;
  reopening_.Pause();
}

// Reads all reports that have arrived, so that a backlog needs no further polling. The number is
// limited, because a device that sends without pause must not block the caller. False without a
// report.
bool HidrawSource::Read(int timeout_ms, const Sink& sink) {
  std::array<std::uint8_t, 2 * sizeof(protocol::InputReport)> bytes{};
  for (int i = 0; i < kBurst && gone_.empty(); ++i) {
    const int size = hid_read_timeout(device_, bytes.data(), bytes.size(), i == 0 ? timeout_ms : 0);
    if (size < 0) gone_ = "was unplugged";
    if (size <= 0) return i > 0 || size < 0;
    sink({.kind = SourceEvent::Kind::kReport,
          .host_us = bus::MonotonicUs(),
          .report = std::span(bytes).first(static_cast<std::size_t>(size)),
          .text = {}});
  }
  return true;
}

// Checks the return value of a hidapi feature request: returns it, or throws if the request failed.
int HidrawSource::Checked(int result) {
  const int reason = errno;
  if (result >= 0) return result;
  if (reason == ENODEV || reason == ESHUTDOWN) {
    gone_ = "was unplugged";
    throw DeviceGone("the device was disconnected");
  }
  if (reason == EPIPE) throw FeatureError("the device refused the request");
  if (reason == ETIMEDOUT) throw FeatureTimeout("the device did not answer in time");
  throw FeatureError(std::strerror(reason));
}

std::vector<std::uint8_t> HidrawSource::GetFeature(std::uint8_t report_id) {
  if (device_ == nullptr || !gone_.empty()) throw DeviceGone("no device is connected");
  std::vector<std::uint8_t> report(protocol::kLongestReportBytes);
  report[0] = report_id;
  const int size = Checked(hid_get_feature_report(device_, report.data(), report.size()));
  report.resize(static_cast<std::size_t>(size));
  if (report.empty() || report[0] != report_id) {
    throw FeatureError("the device answered with another feature report than the requested one");
  }
  return report;
}

void HidrawSource::SetFeature(std::span<const std::uint8_t> report) {
  if (device_ == nullptr || !gone_.empty()) throw DeviceGone("no device is connected");
  Checked(hid_send_feature_report(device_, report.data(), report.size()));
}

}  // namespace torquer::device
