#include "host/emulator/umockdev_front.h"

#include <linux/usbdevice_fs.h>
#include <sys/ioctl.h>
#include <umockdev.h>

#include <algorithm>
#include <cerrno>
#include <chrono>
#include <condition_variable>
#include <cstdio>
#include <cstring>
#include <deque>
#include <future>
#include <optional>
#include <set>
#include <utility>
#include <vector>

#include "host/support/error.h"

namespace torquer::emulator {
namespace {

constexpr auto kFrame = std::chrono::milliseconds(1);
// A usbfs file is always writable under umockdev, so that libusb asks again at once; a short wait
// keeps it from spinning.
constexpr auto kReapWait = std::chrono::milliseconds(2);
// How long a frame waits for the IN transfer of a program that has claimed the interface.
constexpr auto kLongestFrame = std::chrono::seconds(2);
constexpr std::size_t kSetupBytes = 8;

/// A transfer of the program, in its memory; umockdev copies back what changes here.
struct Urb {
  UMockdevIoctlData* urb = nullptr;
  UMockdevIoctlData* buffer = nullptr;

  usbdevfs_urb& get() const { return *reinterpret_cast<usbdevfs_urb*>(urb->data); }
  gulong address() const { return urb->client_addr; }
};

}  // namespace

/// The mocked bus: one device node, its ioctls, and the transfers between them and the host model.
class UmockdevBench::Bus {
 public:
  explicit Bus(UsbHost& host) : host_(host) {
    testbed_ = umockdev_testbed_new();
    if (!umockdev_in_mock_environment()) {
      g_object_unref(testbed_);
      throw UserError(
          "the device can be mocked only under umockdev: run the program as "
          "`umockdev-wrapper PROGRAM` (package umockdev)");
    }
    host_.wants_input = [this] {
      const std::lock_guard lock(mutex_);
      return !inputs_.empty();
    };
    host_.on_input = [this](const std::vector<std::uint8_t>& report) { Deliver(report); };
    host_.on_input_stall = [this] {
      const std::lock_guard lock(mutex_);
      if (!inputs_.empty()) CompleteInput(-EPIPE, 0);
    };
  }

  ~Bus() {
    if (plugged_) Remove();
    g_object_unref(testbed_);
  }

  /// Makes the node that programs find. The device must be enumerated.
  void Add() {
    ++device_number_;
    char number[16];
    std::snprintf(number, sizeof(number), "%03d", device_number_);
    node_ = std::string("/dev/bus/usb/001/").append(number);
    system_path_ = "/sys/devices/usb1/1-1";
    {
      const std::lock_guard lock(mutex_);
      gone_ = false;
      claims_ = 0;
    }
    handler_ = umockdev_ioctl_base_new();
    g_signal_connect(handler_, "handle-ioctl", G_CALLBACK(&Bus::OnIoctl), this);
    GError* error = nullptr;
    umockdev_testbed_attach_ioctl(testbed_, node_.c_str(), handler_, &error);
    Check(error);

    const Enumeration& device = host_.enumeration();
    std::string descriptors;
    for (const auto* bytes : {&device.device_descriptor, &device.configuration_descriptor}) {
      for (const std::uint8_t byte : *bytes) {
        char hex[3];
        std::snprintf(hex, sizeof(hex), "%02x", byte);
        descriptors += hex;
      }
    }
    char ids[80];
    const auto& head = device.device_descriptor;
    std::snprintf(ids, sizeof(ids), "A: idVendor=%02x%02x\\n\nA: idProduct=%02x%02x\\n\n", head[9],
                  head[8], head[11], head[10]);
    const std::string record =
        std::string("P: /devices/usb1/1-1\nN: bus/usb/001/")
            .append(number)
            .append("\nE: SUBSYSTEM=usb\nE: DEVTYPE=usb_device\nE: BUSNUM=001\nE: DEVNUM=")
            .append(number)
            .append("\nE: DEVNAME=")
            .append(node_)
            .append("\nA: bConfigurationValue=1\\n\nA: busnum=1\\n\nA: devnum=")
            .append(std::to_string(device_number_))
            .append("\\n\nA: speed=12\\n\n")
            .append(ids)
            .append("A: serial=")
            .append(device.serial)
            .append("\\n\nH: descriptors=")
            .append(descriptors)
            .append("\n");
    umockdev_testbed_add_from_string(testbed_, record.c_str(), &error);
    Check(error);
    plugged_ = true;
  }

  void Remove() {
    {
      const std::lock_guard lock(mutex_);
      gone_ = true;
      while (!inputs_.empty()) CompleteInput(-ESHUTDOWN, 0);
      changed_.notify_all();
    }
    umockdev_testbed_uevent(testbed_, system_path_.c_str(), "remove");
    umockdev_testbed_remove_device(testbed_, system_path_.c_str());
    GError* error = nullptr;
    umockdev_testbed_detach_ioctl(testbed_, node_.c_str(), &error);
    g_clear_error(&error);
    g_object_unref(handler_);
    handler_ = nullptr;
    plugged_ = false;
  }

  bool plugged() const { return plugged_; }

  /// Hands the program's control transfers to the host model. In the device's thread.
  void Service() {
    std::deque<Urb> controls;
    {
      const std::lock_guard lock(mutex_);
      if (!hang_control_) controls.swap(controls_);
    }
    for (const Urb& urb : controls) SubmitControl(urb);
    std::optional<std::promise<void>> waiter;
    if (const std::lock_guard lock(mutex_); clear_halt_) {
      waiter = std::move(clear_halt_);
      clear_halt_.reset();
    }
    if (waiter) {
      auto shared = std::make_shared<std::promise<void>>(std::move(*waiter));
      host_.Submit({0x02, 1, 0, 0x81, 0}, {},
                   [shared](const ControlResult&) { shared->set_value(); });
    }
  }

  /// Waits while a program that has claimed the interface owes a transfer.
  void WaitForProgram() {
    std::unique_lock lock(mutex_);
    changed_.wait_for(lock, kLongestFrame, [this] {
      return claims_ == 0 || !inputs_.empty() || !controls_.empty() || controls_under_way_ > 0 ||
             gone_ || clear_halt_;
    });
  }

  void ShortenNextInput(std::size_t bytes) {
    const std::lock_guard lock(mutex_);
    shorten_to_ = bytes;
  }
  void StallNextInput() {
    const std::lock_guard lock(mutex_);
    stall_next_ = true;
  }
  void HangControl(bool hang) {
    const std::lock_guard lock(mutex_);
    hang_control_ = hang;
  }
  std::int64_t delivered() const {
    const std::lock_guard lock(mutex_);
    return delivered_;
  }

 private:
  static void Check(GError* error) {
    if (!error) return;
    const std::string message = error->message;
    g_error_free(error);
    throw std::runtime_error("umockdev: " + message);
  }

  static gboolean OnIoctl(UMockdevIoctlBase*, UMockdevIoctlClient* client, gpointer self) {
    return static_cast<Bus*>(self)->Ioctl(client);
  }

  gboolean Ioctl(UMockdevIoctlClient* client) {
    UMockdevIoctlData* argument = umockdev_ioctl_client_get_arg(client);
    const gulong request = umockdev_ioctl_client_get_request(client);
    const auto answer = [client](glong result, gint error) {
      umockdev_ioctl_client_complete(client, result, error);
      return TRUE;
    };
    if (const std::lock_guard lock(mutex_); gone_ && request != USBDEVFS_REAPURBNDELAY) {
      return answer(-1, ENODEV);
    }
    switch (request) {
      case USBDEVFS_GET_CAPABILITIES: {
        UMockdevIoctlData* data =
            umockdev_ioctl_data_resolve(argument, 0, sizeof(std::uint32_t), nullptr);
        const std::uint32_t capabilities = USBDEVFS_CAP_BULK_CONTINUATION |
                                           USBDEVFS_CAP_NO_PACKET_SIZE_LIM |
                                           USBDEVFS_CAP_REAP_AFTER_DISCONNECT;
        std::memcpy(data->data, &capabilities, sizeof(capabilities));
        g_object_unref(data);
        return answer(0, 0);
      }
      case USBDEVFS_CLAIMINTERFACE:
        Claim(+1);
        return answer(0, 0);
      case USBDEVFS_RELEASEINTERFACE:
        Claim(-1);
        return answer(0, 0);
      case USBDEVFS_SETCONFIGURATION:
      case USBDEVFS_SETINTERFACE:
      case USBDEVFS_RESETEP:
      case USBDEVFS_RESET:
        return answer(0, 0);
      case USBDEVFS_CLEAR_HALT:
        ClearHalt();
        return answer(0, 0);
      case USBDEVFS_GETDRIVER:
      case USBDEVFS_IOCTL:  // no kernel driver to detach
        return answer(-1, ENODATA);
      case USBDEVFS_SUBMITURB:
        Submit(argument);
        return answer(0, 0);
      case USBDEVFS_REAPURB:
      case USBDEVFS_REAPURBNDELAY:
        return Reap(client, argument);
      case USBDEVFS_DISCARDURB:
        return Discard(argument) ? answer(0, 0) : answer(-1, EINVAL);
      default:
        return answer(-1, ENOTTY);
    }
  }

  void Claim(int change) {
    const std::lock_guard lock(mutex_);
    claims_ += change;
    changed_.notify_all();
  }

  void ClearHalt() {
    std::future<void> done;
    {
      const std::lock_guard lock(mutex_);
      clear_halt_.emplace();
      done = clear_halt_->get_future();
      changed_.notify_all();
    }
    done.wait_for(std::chrono::seconds(5));
  }

  void Submit(UMockdevIoctlData* argument) {
    Urb urb;
    urb.urb = umockdev_ioctl_data_resolve(argument, 0, sizeof(usbdevfs_urb), nullptr);
    if (urb.get().buffer_length > 0) {
      urb.buffer =
          umockdev_ioctl_data_resolve(urb.urb, offsetof(usbdevfs_urb, buffer),
                                      static_cast<gsize>(urb.get().buffer_length), nullptr);
    }
    const std::lock_guard lock(mutex_);
    if (urb.get().type == USBDEVFS_URB_TYPE_CONTROL) {
      controls_.push_back(urb);
    } else {
      inputs_.push_back(urb);
    }
    changed_.notify_all();
  }

  gboolean Reap(UMockdevIoctlClient* client, UMockdevIoctlData* argument) {
    std::unique_lock lock(mutex_);
    reapable_.wait_for(lock, kReapWait, [this] { return !completed_.empty() || gone_; });
    if (completed_.empty()) {
      const int error = gone_ ? ENODEV : EAGAIN;
      lock.unlock();
      umockdev_ioctl_client_complete(client, -1, error);
      return TRUE;
    }
    const Urb urb = completed_.front();
    completed_.pop_front();
    lock.unlock();
    UMockdevIoctlData* pointer =
        umockdev_ioctl_data_resolve(argument, 0, sizeof(gpointer), nullptr);
    umockdev_ioctl_data_set_ptr(pointer, 0, urb.urb);
    umockdev_ioctl_client_complete(client, 0, 0);
    g_object_unref(pointer);
    Release(urb);
    return TRUE;
  }

  bool Discard(UMockdevIoctlData* argument) {
    gulong address = 0;
    std::memcpy(&address, argument->data, sizeof(address));
    const std::lock_guard lock(mutex_);
    for (std::deque<Urb>* queue : {&inputs_, &controls_}) {
      for (auto urb = queue->begin(); urb != queue->end(); ++urb) {
        if (urb->address() != address) continue;
        const Urb discarded = *urb;
        queue->erase(urb);
        Complete(discarded, -ENOENT, 0);
        return true;
      }
    }
    return false;
  }

  static void Release(const Urb& urb) {
    if (urb.buffer) g_object_unref(urb.buffer);
    g_object_unref(urb.urb);
  }

  void SubmitControl(const Urb& urb) {
    const std::uint8_t* bytes = urb.buffer->data;
    const auto word = [bytes](int at) {
      return static_cast<std::uint16_t>(bytes[at] | (bytes[at + 1] << 8));
    };
    const SetupPacket setup{bytes[0], bytes[1], word(2), word(4), word(6)};
    std::vector<std::uint8_t> data;
    if (!(setup.type & 0x80)) {
      data.assign(bytes + kSetupBytes, bytes + kSetupBytes + setup.length);
    }
    {
      const std::lock_guard lock(mutex_);
      ++controls_under_way_;
    }
    host_.Submit(setup, std::move(data), [this, urb, setup](const ControlResult& result) {
      std::size_t length = setup.length;
      if (setup.type & 0x80) {
        length = std::min<std::size_t>(result.data.size(), setup.length);
        std::copy_n(result.data.begin(), length, urb.buffer->data + kSetupBytes);
      }
      const std::lock_guard lock(mutex_);
      --controls_under_way_;
      switch (result.status) {
        case TransferStatus::kDone:
          return Complete(urb, 0, length);
        case TransferStatus::kStall:
          return Complete(urb, -EPIPE, 0);
        case TransferStatus::kTimeout:
          return Complete(urb, -ETIMEDOUT, 0);
        case TransferStatus::kGone:
          return Complete(urb, -ENODEV, 0);
      }
    });
  }

  void Deliver(const std::vector<std::uint8_t>& report) {
    const std::lock_guard lock(mutex_);
    if (inputs_.empty()) return;
    if (std::exchange(stall_next_, false)) return CompleteInput(-EPIPE, 0);
    std::size_t size =
        std::min(report.size(), static_cast<std::size_t>(inputs_.front().get().buffer_length));
    if (shorten_to_) size = std::min(size, *std::exchange(shorten_to_, std::nullopt));
    std::memcpy(inputs_.front().buffer->data, report.data(), size);
    ++delivered_;
    CompleteInput(0, size);
  }

  // The mutex is held.
  void CompleteInput(int status, std::size_t length) {
    const Urb urb = inputs_.front();
    inputs_.pop_front();
    Complete(urb, status, length);
  }
  void Complete(const Urb& urb, int status, std::size_t length) {
    urb.get().status = status;
    urb.get().actual_length = static_cast<int>(length);
    completed_.push_back(urb);
    reapable_.notify_all();
  }

  UsbHost& host_;
  UMockdevTestbed* testbed_ = nullptr;
  UMockdevIoctlBase* handler_ = nullptr;
  std::string node_;
  std::string system_path_;
  int device_number_ = 1;
  bool plugged_ = false;

  mutable std::mutex mutex_;
  std::condition_variable changed_;   // for the device's thread
  std::condition_variable reapable_;  // for the program
  std::deque<Urb> inputs_, controls_, completed_;
  std::optional<std::promise<void>> clear_halt_;
  std::optional<std::size_t> shorten_to_;
  bool stall_next_ = false;
  bool hang_control_ = false;
  bool gone_ = false;
  int claims_ = 0;
  int controls_under_way_ = 0;
  std::int64_t delivered_ = 0;
};

UmockdevBench::UmockdevBench(const FirmwareImage& image, const BenchOptions& options,
                             std::function<HandState(double)> hand)
    : device_(image, options), host_(device_), bus_(std::make_unique<Bus>(host_)) {
  device_.SetHand(std::move(hand));
  Plug();
  thread_ = std::thread([this] { Run(); });
}

UmockdevBench::~UmockdevBench() {
  stop_ = true;
  thread_.join();
}

void UmockdevBench::Plug() {
  const std::lock_guard lock(device_mutex_);
  device_.PowerOn();
  if (!host_.RunUntilReady()) throw std::runtime_error("the device was not enumerated");
  bus_->Add();
}

void UmockdevBench::Unplug() {
  const std::lock_guard lock(device_mutex_);
  device_.PowerOff();
  host_.RunFrame();
  if (bus_->plugged()) bus_->Remove();
}

void UmockdevBench::Do(const std::function<void(BenchDevice&, UsbHost&)>& action) {
  const std::lock_guard lock(device_mutex_);
  action(device_, host_);
}

void UmockdevBench::ShortenNextInput(std::size_t bytes) { bus_->ShortenNextInput(bytes); }
void UmockdevBench::StallNextInput() { bus_->StallNextInput(); }
void UmockdevBench::HangControl(bool hang) { bus_->HangControl(hang); }
std::int64_t UmockdevBench::inputs_delivered() const { return bus_->delivered(); }

void UmockdevBench::Run() {
  auto next_frame = std::chrono::steady_clock::now();
  while (!stop_) {
    std::this_thread::sleep_until(next_frame);
    bus_->WaitForProgram();
    {
      const std::lock_guard lock(device_mutex_);
      bus_->Service();
      host_.RunFrame();
      // A reset of the device by itself: it leaves the bus and comes back.
      if (bus_->plugged() && !host_.ready()) bus_->Remove();
      if (!bus_->plugged() && host_.ready()) bus_->Add();
    }
    next_frame = std::max(next_frame + kFrame, std::chrono::steady_clock::now() - kFrame);
  }
}

}  // namespace torquer::emulator
