#include "host/device/usb_source.h"

#include <fmt/format.h>
#include <fmt/ranges.h>
#include <sys/time.h>

#include <algorithm>
#include <utility>

#include "host/bus/clock.h"
#include "host/device/device_identity.h"
#include "host/device/usb.h"
#include "host/support/error.h"
#include "protocol/usb_ids.h"

namespace torquer::device {
namespace {

constexpr int kInterface = 0;
constexpr std::uint8_t kEndpoint = LIBUSB_ENDPOINT_IN | protocol::kInputEndpoint;
constexpr unsigned kControlTimeoutMs = 1000;
constexpr std::uint8_t kGetReport = 0x01;  // HID 1.11, 7.2
constexpr std::uint8_t kSetReport = 0x09;
constexpr std::uint16_t kFeatureReport = 0x0300;
constexpr std::size_t kLargestReport = protocol::kLongestReportBytes;
// Number of consecutive transfer errors that mean an unplugged device.
constexpr int kMostErrorsInARow = 50;
// Permissions are granted by udev, perhaps a moment after the device is announced.
constexpr std::int64_t kUsbPermissionUs = 1000000;
// A device that was just plugged in may fail at first. If it fails for longer, the next attempt
// follows at the next listing of the bus.
constexpr std::int64_t kOpenUs = 3000000;
constexpr std::int64_t kListUs = 1000000;

}  // namespace

UsbSource::UsbSource(std::string serial) : serial_(std::move(serial)) {
  int error = libusb_init(&context_);
  if (error == 0) {
    error = libusb_hotplug_register_callback(
        context_, LIBUSB_HOTPLUG_EVENT_DEVICE_ARRIVED | LIBUSB_HOTPLUG_EVENT_DEVICE_LEFT,
        LIBUSB_HOTPLUG_ENUMERATE, protocol::kUsbVendorId, LIBUSB_HOTPLUG_MATCH_ANY,
        LIBUSB_HOTPLUG_MATCH_ANY, &UsbSource::OnHotplug, this, &hotplug_);
  }
  if (error != 0) {
    throw UserError(fmt::format(
        "the USB cannot be used: {}; check that /dev/bus/usb exists. The emulator needs none: "
        "--source socket",
        libusb_strerror(error)));
  }
}

UsbSource::~UsbSource() {
  Stop();
  libusb_hotplug_deregister_callback(context_, hotplug_);
  for (const Candidate& candidate : candidates_) libusb_unref_device(candidate.device);
  for (libusb_device* other : others_) libusb_unref_device(other);
  libusb_exit(context_);
}

std::string UsbSource::place() const {
  std::string place =
      fmt::format("USB ({:04x}:{:04x}{}{})", protocol::kUsbVendorId, protocol::kUsbProductId,
                  serial_.empty() ? "" : ", serial number ", serial_);
  if (bootloader_seen_ && handle_ == nullptr) {
    place += fmt::format(", where a device waits in its bootloader: {},", kFlashRemedy);
  }
  return place;
}

void UsbSource::Interrupt() { libusb_interrupt_event_handler(context_); }

int UsbSource::OnHotplug(libusb_context* /*context*/, libusb_device* device,
                         libusb_hotplug_event event, void* self) {
  auto& source = *static_cast<UsbSource*>(self);
  libusb_device_descriptor descriptor{};
  libusb_get_device_descriptor(device, &descriptor);
  if (event == LIBUSB_HOTPLUG_EVENT_DEVICE_LEFT) {
    if (source.handle_ != nullptr && libusb_get_device(source.handle_) == device) {
      source.gone_ = "was unplugged";
    }
    if (descriptor.idProduct == protocol::kUsbBootloaderProductId) source.bootloader_seen_ = false;
    // Marks only, because TakeCandidates() may be calling this.
    for (Candidate& candidate : source.candidates_) {
      if (candidate.device == device) candidate.left = true;
    }
    return 0;
  }
  if (descriptor.idProduct == protocol::kUsbBootloaderProductId) source.bootloader_seen_ = true;
  if (descriptor.idProduct == protocol::kUsbProductId && !source.Waits(device)) {
    // A callback must send no request to the device; Wait() sends it.
    source.candidates_.push_back({libusb_ref_device(device), bus::MonotonicUs(), false});
  }
  return 0;
}

void UsbSource::OnTransfer(libusb_transfer* transfer) {
  const std::int64_t host_us = bus::MonotonicUs();
  auto& own = *static_cast<Transfer*>(transfer->user_data);
  UsbSource& source = *own.source;
  own.in_flight = false;
  switch (transfer->status) {
    case LIBUSB_TRANSFER_COMPLETED:
      source.errors_in_a_row_ = 0;
      source.stalled_ = false;  // an earlier stall did not halt the endpoint
      source.arrivals_.push_back({host_us, transfer->actual_length, own.bytes});
      source.Submit(own);
      break;
    case LIBUSB_TRANSFER_OVERFLOW:
      // Longer than any report of the device: counted as a report of a wrong length.
      source.arrivals_.push_back({host_us, 0, {}});
      source.Submit(own);
      break;
    case LIBUSB_TRANSFER_STALL:
      source.stalled_ = true;  // Revive() clears it; it cannot be cleared from here
      break;
    case LIBUSB_TRANSFER_NO_DEVICE:
      source.gone_ = "was unplugged";
      break;
    case LIBUSB_TRANSFER_CANCELLED:
      break;
    case LIBUSB_TRANSFER_ERROR:
    case LIBUSB_TRANSFER_TIMED_OUT:
      if (++source.errors_in_a_row_ >= kMostErrorsInARow) {
        source.LetGo("gives only transfer errors");
      }
      break;  // Revive() submits it again
  }
}

void UsbSource::Submit(Transfer& transfer) {
  if (handle_ == nullptr || !gone_.empty()) return;
  const int error = libusb_submit_transfer(transfer.transfer);
  transfer.in_flight = error == 0;
  if (error == LIBUSB_ERROR_NO_DEVICE) gone_ = "was unplugged";
}

// Submits transfers again that a stall or an error has stopped.
void UsbSource::Revive() {
  if (handle_ == nullptr || !gone_.empty()) return;
  if (std::exchange(stalled_, false)) {
    const bool idle = std::none_of(transfers_.begin(), transfers_.end(),
                                   [](const auto& transfer) { return transfer->in_flight; });
    // The stall ends every transfer on the endpoint; the ends of the others are still to come.
    if (!idle) {
      stalled_ = true;
      return;
    }
    if (libusb_clear_halt(handle_, kEndpoint) == LIBUSB_ERROR_NO_DEVICE) gone_ = "was unplugged";
  }
  for (const auto& transfer : transfers_) {
    if (!transfer->in_flight) Submit(*transfer);
  }
}

void UsbSource::Wait(int timeout_ms, const Sink& sink) {
  const auto open = [this] {
    ListTheBus();
    return TakeCandidates();
  };
  if (handle_ == nullptr && reopening_.Try(open, sink)) {
    sink({.kind = SourceEvent::Kind::kConnected,
          .host_us = bus::MonotonicUs(),
          .report = {},
          .text = address_});
  }
  Revive();
  timeval timeout{timeout_ms / 1000, (timeout_ms % 1000) * 1000};
  if (arrivals_.empty()) libusb_handle_events_timeout_completed(context_, &timeout, nullptr);
  Deliver(sink);
  if (handle_ == nullptr || gone_.empty()) return;
  const std::string reason = address_ + " " + gone_;
  Stop();
  sink({.kind = SourceEvent::Kind::kDisconnected,
        .host_us = bus::MonotonicUs(),
        .report = {},
        .text = reason});
}

void UsbSource::LetGo(const std::string& reason) {
  if (handle_ == nullptr || !gone_.empty()) return;
  gone_ = reason;
  reopening_.Pause();
}

void UsbSource::Deliver(const Sink& sink) {
  // Asking for a feature from within the sink lets further reports arrive.
  const std::vector<Arrival> arrived = std::exchange(arrivals_, {});
  for (const Arrival& arrival : arrived) {
    sink({.kind = SourceEvent::Kind::kReport,
          .host_us = arrival.host_us,
          .report = std::span(arrival.bytes).first(static_cast<std::size_t>(arrival.size)),
          .text = {}});
  }
}

// Adds connected devices that are new, without known devices of other makers. The kernel announces
// arrivals, but not every return of a device.
void UsbSource::ListTheBus() {
  const std::int64_t now_us = bus::MonotonicUs();
  if (now_us - listed_us_ < kListUs) return;
  listed_us_ = now_us;
  libusb_device** list = nullptr;
  const ssize_t count = libusb_get_device_list(context_, &list);
  if (count < 0) return;
  const std::span<libusb_device*> here(list, static_cast<std::size_t>(count));
  const auto gone = [&](libusb_device* device) {
    return std::find(here.begin(), here.end(), device) == here.end();
  };
  for (libusb_device*& other : others_) {
    if (gone(other)) libusb_unref_device(std::exchange(other, nullptr));
  }
  std::erase(others_, nullptr);
  for (libusb_device* device : here) {
    libusb_device_descriptor descriptor{};
    libusb_get_device_descriptor(device, &descriptor);
    if (descriptor.idVendor != protocol::kUsbVendorId ||
        descriptor.idProduct != protocol::kUsbProductId || Waits(device) ||
        std::find(others_.begin(), others_.end(), device) != others_.end()) {
      continue;
    }
    candidates_.push_back({libusb_ref_device(device), now_us, false});
  }
  libusb_free_device_list(list, 1);
}

bool UsbSource::TakeCandidates() {
  std::vector<OpenDevice> found;
  try {
    TryCandidates(found);
    if (found.size() > 1) {
      std::vector<std::string> serials;
      for (const OpenDevice& device : found) serials.push_back(device.serial);
      throw UserError(
          fmt::format("several bench devices are plugged in: {}; choose one with --device",
                      fmt::join(serials, ", ")));
    }
    if (!found.empty() && Start(found.front())) return true;
  } catch (...) {
    for (const OpenDevice& device : found) libusb_close(device.handle);
    throw;
  }
  for (const OpenDevice& device : found) libusb_close(device.handle);
  return false;
}

bool UsbSource::Waits(libusb_device* device) const {
  return std::any_of(candidates_.begin(), candidates_.end(),
                     [&](const Candidate& one) { return one.device == device; });
}

void UsbSource::TryCandidates(std::vector<OpenDevice>& found) {
  for (std::size_t count = candidates_.size(); count > 0; --count) {
    // Takes the list out first, because opening a device may add others, and may throw.
    const Candidate candidate = candidates_.front();
    candidates_.pop_front();
    const std::unique_ptr<libusb_device, void (*)(libusb_device*)> kept(candidate.device,
                                                                        &libusb_unref_device);
    if (candidate.left) continue;
    const Trial trial = TryOpen(candidate, found);
    const bool too_late = bus::MonotonicUs() - candidate.seen_us > kOpenUs;
    if (trial == Trial::kOther) others_.push_back(libusb_ref_device(candidate.device));
    if (trial == Trial::kNotNow && !too_late) {
      candidates_.push_back({libusb_ref_device(candidate.device), candidate.seen_us, false});
    }
  }
}

// Devices added to `found` stay open.
UsbSource::Trial UsbSource::TryOpen(const Candidate& candidate, std::vector<OpenDevice>& found) {
  OpenDevice device{};
  device.address = UsbAddress(candidate.device);
  const int error = libusb_open(candidate.device, &device.handle);
  if (error == LIBUSB_ERROR_ACCESS) return JudgeForbidden(candidate, device.address);
  if (error != 0) return Trial::kNotNow;
  libusb_device_descriptor descriptor{};
  libusb_get_device_descriptor(candidate.device, &descriptor);
  device.serial = UsbText(device.handle, descriptor.iSerialNumber);
  const std::string product = UsbText(device.handle, descriptor.iProduct);
  if (IsOurs(product, device.serial)) {
    found.push_back(device);
    return Trial::kOpen;
  }
  libusb_close(device.handle);
  return product.empty() || device.serial.empty() ? Trial::kNotNow : Trial::kOther;
}

// A device that may not be opened is still described by sysfs.
UsbSource::Trial UsbSource::JudgeForbidden(const Candidate& candidate,
                                           const std::string& address) const {
  const std::string product = UsbTextOfKernel(candidate.device, "product");
  const std::string serial = UsbTextOfKernel(candidate.device, "serial");
  if (!product.empty() && !serial.empty() && !IsOurs(product, serial)) return Trial::kOther;
  if (bus::MonotonicUs() - candidate.seen_us < kUsbPermissionUs) return Trial::kNotNow;
  throw UserError(fmt::format("{} may not be opened by this user; {}", address, kPermissionRemedy));
}

// Prototypes of other makers use the same ids.
bool UsbSource::IsOurs(const std::string& product, const std::string& serial) const {
  return product == protocol::kUsbProduct && !serial.empty() &&
         (serial_.empty() || serial == serial_);
}

// False if the device does not answer, such as one that is being unplugged.
bool UsbSource::HasConfiguration(const OpenDevice& device) const {
  libusb_config_descriptor* configuration = nullptr;
  if (libusb_get_active_config_descriptor(libusb_get_device(device.handle), &configuration) != 0) {
    return false;
  }
  bool fits = false;
  for (int i = 0; i < configuration->bNumInterfaces; ++i) {
    const libusb_interface& interface = configuration->interface[i];
    if (interface.num_altsetting < 1) continue;
    const libusb_interface_descriptor& setting = interface.altsetting[0];
    for (int k = 0; k < setting.bNumEndpoints; ++k) {
      fits = fits || (setting.bInterfaceNumber == kInterface &&
                      setting.endpoint[k].bEndpointAddress == kEndpoint &&
                      setting.endpoint[k].wMaxPacketSize == sizeof(protocol::InputReport));
    }
  }
  libusb_free_config_descriptor(configuration);
  if (!fits) {
    throw UserError(fmt::format(
        "{}: the device has no input endpoint for reports of {} bytes: it runs other firmware; {}",
        device.address, sizeof(protocol::InputReport), kFlashRemedy));
  }
  return true;
}

// False if the device is being unplugged; the caller then still owns it.
bool UsbSource::Start(const OpenDevice& device) {
  if (!HasConfiguration(device)) return false;
  libusb_set_auto_detach_kernel_driver(device.handle, 1);
  const int error = libusb_claim_interface(device.handle, kInterface);
  if (error == LIBUSB_ERROR_NO_DEVICE) return false;
  if (error != 0) {
    throw UserError(
        fmt::format("{}: the device cannot be claimed ({}); stop the other program that uses it",
                    device.address, libusb_strerror(error)));
  }
  handle_ = device.handle;
  address_ = device.address;
  serial_ = device.serial;
  gone_.clear();
  stalled_ = false;
  errors_in_a_row_ = 0;
  for (int i = 0; i < kTransfers; ++i) {
    auto transfer = std::make_unique<Transfer>();
    transfer->source = this;
    transfer->transfer = libusb_alloc_transfer(0);
    libusb_fill_interrupt_transfer(transfer->transfer, handle_, kEndpoint, transfer->bytes.data(),
                                   static_cast<int>(transfer->bytes.size()), &UsbSource::OnTransfer,
                                   transfer.get(), 0);
    transfers_.push_back(std::move(transfer));
  }
  return true;
}

// Ends the transfers before the device is closed.
void UsbSource::Stop() {
  if (handle_ == nullptr) return;
  if (gone_.empty()) gone_ = "is being closed";  // so that no transfer is submitted any more
  const auto busy = [this] {
    return std::any_of(transfers_.begin(), transfers_.end(),
                       [](const auto& transfer) { return transfer->in_flight; });
  };
  for (const auto& transfer : transfers_) {
    if (transfer->in_flight) libusb_cancel_transfer(transfer->transfer);
  }
  for (int i = 0; i < 100 && busy(); ++i) {
    timeval step{0, 10000};
    libusb_handle_events_timeout_completed(context_, &step, nullptr);
  }
  for (auto& transfer : transfers_) {
    // A transfer that the kernel has not returned within a second is leaked on purpose. The kernel
    // may still write to it.
    if (transfer->in_flight) {
      static_cast<void>(transfer.release());
    } else {
      libusb_free_transfer(transfer->transfer);
    }
  }
  transfers_.clear();
  arrivals_.clear();
  libusb_release_interface(handle_, kInterface);
  libusb_close(handle_);
  handle_ = nullptr;
}

int UsbSource::Control(std::uint8_t direction, std::uint8_t request, std::uint8_t report_id,
                       std::span<std::uint8_t> bytes) {
  if (handle_ == nullptr || !gone_.empty()) throw DeviceGone("no device is connected");
  const int result = libusb_control_transfer(
      handle_, direction | LIBUSB_REQUEST_TYPE_CLASS | LIBUSB_RECIPIENT_INTERFACE, request,
      static_cast<std::uint16_t>(kFeatureReport | report_id), kInterface, bytes.data(),
      static_cast<std::uint16_t>(bytes.size()), kControlTimeoutMs);
  if (result == LIBUSB_ERROR_NO_DEVICE) {
    gone_ = "was unplugged";
    throw DeviceGone("the device was disconnected");
  }
  if (result == LIBUSB_ERROR_PIPE) throw FeatureError("the device refused the request");
  if (result == LIBUSB_ERROR_TIMEOUT) {
    throw FeatureTimeout("the device did not answer within a second");
  }
  if (result < 0) throw FeatureError(libusb_strerror(result));
  return result;
}

std::vector<std::uint8_t> UsbSource::GetFeature(std::uint8_t report_id) {
  std::vector<std::uint8_t> report(kLargestReport);
  const int size = Control(LIBUSB_ENDPOINT_IN, kGetReport, report_id, report);
  report.resize(static_cast<std::size_t>(size));
  if (report.empty() || report[0] != report_id) {
    throw FeatureError("the device answered with another feature report than the requested one");
  }
  return report;
}

void UsbSource::SetFeature(std::span<const std::uint8_t> report) {
  std::vector<std::uint8_t> bytes(report.begin(), report.end());
  Control(LIBUSB_ENDPOINT_OUT, kSetReport, report[0], bytes);
}

}  // namespace torquer::device
