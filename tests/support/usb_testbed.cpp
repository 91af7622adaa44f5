#include "tests/support/usb_testbed.h"

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
#include <list>
#include <map>
#include <mutex>
#include <stdexcept>

#include "host/emulator/umockdev_handler.h"
#include "host/emulator/umockdev_machine.h"

namespace torquer::test {
namespace {

// Waiting time of a reap: the mocked device file is always ready, so libusb would spin otherwise.
constexpr std::chrono::milliseconds kReapWait{2};

void Put16(std::vector<std::uint8_t>& bytes, std::uint16_t value) {
  bytes.push_back(static_cast<std::uint8_t>(value & 0xff));
  bytes.push_back(static_cast<std::uint8_t>(value >> 8));
}

// Device and configuration descriptor, as in the kernel's "descriptors" file.
std::string DescriptorsInHex(const UsbDeviceScript& script) {
  std::vector<std::uint8_t> bytes{18, 1, 0x00, 0x02, 0, 0, 0, 32};
  Put16(bytes, script.vendor_id);
  Put16(bytes, script.product_id);
  Put16(bytes, 0x0100);
  bytes.insert(bytes.end(), {1, 2, 3, 1});
  bytes.insert(bytes.end(), {9, 2, 34, 0, 1, 1, 0, 0x80, 50});          // configuration
  bytes.insert(bytes.end(), {9, 4, 0, 0, 1, 3, 0, 0, 0});               // interface: HID
  bytes.insert(bytes.end(), {9, 0x21, 0x11, 0x01, 0, 1, 0x22, 55, 0});  // HID
  bytes.insert(bytes.end(), {7, 5, 0x81, 3});                           // endpoint: interrupt IN
  Put16(bytes, script.input_packet_bytes);
  bytes.push_back(1);
  std::string hex;
  char digits[3];
  for (const std::uint8_t byte : bytes) {
    std::snprintf(digits, sizeof digits, "%02x", byte);
    hex += digits;
  }
  return hex;
}

std::vector<std::uint8_t> StringDescriptor(const std::string& text) {
  std::vector<std::uint8_t> bytes{static_cast<std::uint8_t>(2 + 2 * text.size()), 3};
  for (const char character : text) Put16(bytes, static_cast<std::uint8_t>(character));
  return bytes;
}

std::string DevicePath(int address) { return "/devices/usb1/1-" + std::to_string(address); }

std::string NodePath(int address) {
  char path[40];
  std::snprintf(path, sizeof path, "/dev/bus/usb/001/%03d", address);
  return path;
}

void Check(GError* error, const char* what) {
  if (error == nullptr) return;
  const std::string message = std::string(what) + ": " + error->message;
  g_error_free(error);
  throw std::runtime_error(message);
}

// Transfer of the client: its usbdevfs_urb and buffer.
struct Transfer {
  UMockdevIoctlData* urb;
  UMockdevIoctlData* buffer;

  usbdevfs_urb& Urb() const { return *reinterpret_cast<usbdevfs_urb*>(urb->data); }
  void End(int status, int length) const {
    Urb().status = status;
    Urb().actual_length = length;
  }
};

}  // namespace

// usbfs for one device. umockdev's threads call its ioctls.
struct UsbTestbed::Device {
  explicit Device(const UsbDeviceScript& device_script) : script(device_script) {}

  static bool Complete(UMockdevIoctlClient* client, int result, int error) {
    umockdev_ioctl_client_complete(client, result, error);
    return true;
  }

  bool Ioctl(UMockdevIoctlClient* client) {
    const unsigned long request = umockdev_ioctl_client_get_request(client);
    UMockdevIoctlData* argument = umockdev_ioctl_client_get_arg(client);
    std::unique_lock lock(mutex);
    switch (request) {
      case USBDEVFS_REAPURB:
      case USBDEVFS_REAPURBNDELAY:
        return Reap(client, argument, lock);
      case USBDEVFS_DISCARDURB:
        return Discard(client, argument);
      default:
        break;
    }
    if (gone) return Complete(client, -1, ENODEV);
    switch (request) {
      case USBDEVFS_GET_CAPABILITIES: {
        UMockdevIoctlData* data = umockdev_ioctl_data_resolve(argument, 0, 4, nullptr);
        if (data == nullptr) return Complete(client, -1, EFAULT);
        const std::uint32_t capabilities =
            USBDEVFS_CAP_NO_PACKET_SIZE_LIM | USBDEVFS_CAP_REAP_AFTER_DISCONNECT;
        std::memcpy(data->data, &capabilities, sizeof capabilities);
        g_object_unref(data);
        return Complete(client, 0, 0);
      }
      case USBDEVFS_GETDRIVER:
      case USBDEVFS_IOCTL:
        return Complete(client, -1, ENODATA);
      case USBDEVFS_CLAIMINTERFACE:
      case USBDEVFS_DISCONNECT_CLAIM:
        if (script.lost_claims > 0) {
          --script.lost_claims;
          return Complete(client, -1, ENODEV);
        }
        if (script.busy) return Complete(client, -1, EBUSY);
        claimed = true;
        return Complete(client, 0, 0);
      case USBDEVFS_RELEASEINTERFACE:
        claimed = false;
        return Complete(client, 0, 0);
      case USBDEVFS_CLEAR_HALT:
        ++cleared_halts;
        return Complete(client, 0, 0);
      case USBDEVFS_SUBMITURB:
        return Submit(client, argument);
      default:
        return false;
    }
  }

  bool Submit(UMockdevIoctlClient* client, UMockdevIoctlData* argument) {
    // A client killed during its call has no readable memory.
    Transfer transfer{};
    transfer.urb = umockdev_ioctl_data_resolve(argument, 0, sizeof(usbdevfs_urb), nullptr);
    if (transfer.urb == nullptr) return Complete(client, -1, EFAULT);
    transfer.buffer = umockdev_ioctl_data_resolve(
        transfer.urb, G_STRUCT_OFFSET(usbdevfs_urb, buffer),
        static_cast<std::size_t>(transfer.Urb().buffer_length), nullptr);
    if (transfer.buffer == nullptr) {
      g_object_unref(transfer.urb);
      return Complete(client, -1, EFAULT);
    }
    if (transfer.Urb().type == USBDEVFS_URB_TYPE_CONTROL) {
      Answer(transfer);
    } else {
      polls.push_back(transfer);
      Play();
    }
    return Complete(client, 0, 0);
  }

  void Answer(const Transfer& transfer) {
    const std::uint8_t* bytes = transfer.buffer->data;
    ControlRequest request;
    request.type = bytes[0];
    request.request = bytes[1];
    request.value = static_cast<std::uint16_t>(bytes[2] | bytes[3] << 8);
    request.index = static_cast<std::uint16_t>(bytes[4] | bytes[5] << 8);
    const auto length = static_cast<std::size_t>(bytes[6] | bytes[7] << 8);
    const bool to_host = (request.type & 0x80) != 0;
    if (!to_host) request.data.assign(bytes + 8, bytes + 8 + length);

    ControlAnswer answer;
    if (request.type == 0x80 && request.request == 6 && (request.value >> 8) == 3) {
      if (script.stalled_strings > 0) {
        --script.stalled_strings;
        answer.kind = ControlAnswer::Kind::kStall;
      } else {
        answer.data = String(request.value & 0xff);
      }
    } else {
      answer = script.control(request);
    }
    if (answer.kind == ControlAnswer::Kind::kSilence) {
      unanswered.push_back(transfer);
      return;
    }
    const std::size_t size = to_host ? std::min(length, answer.data.size()) : length;
    if (to_host) std::copy_n(answer.data.begin(), size, transfer.buffer->data + 8);
    if (answer.kind == ControlAnswer::Kind::kStall) {
      transfer.End(-EPIPE, 0);
    } else {
      transfer.End(0, static_cast<int>(size));
    }
    Finish(transfer);
  }

  std::vector<std::uint8_t> String(int index) const {
    if (index == 0) return {4, 3, 0x09, 0x04};
    return StringDescriptor(index == 1   ? script.manufacturer
                            : index == 2 ? script.product
                                         : script.serial);
  }

  // Completes waiting polls by the script.
  void Play() {
    while (!polls.empty() && !steps.empty()) {
      const Transfer transfer = polls.front();
      const InputStep step = steps.front();
      polls.pop_front();
      steps.pop_front();
      if (step.kind == InputStep::Kind::kData) {
        const auto room = static_cast<std::size_t>(transfer.Urb().buffer_length);
        const std::size_t size = std::min(room, step.data.size());
        std::copy_n(step.data.begin(), size, transfer.buffer->data);
        transfer.End(step.data.size() > room ? -EOVERFLOW : 0, static_cast<int>(size));
      } else if (step.kind == InputStep::Kind::kError) {
        transfer.End(-EPROTO, 0);
      } else {
        // A halted endpoint ends all transfers queued on it.
        transfer.End(-EPIPE, 0);
        for (const Transfer& other : polls) {
          other.End(-EPIPE, 0);
          Finish(other);
        }
        polls.clear();
      }
      Finish(transfer);
    }
  }

  void Finish(const Transfer& transfer) {
    done.push_back(transfer);
    changed.notify_all();
  }

  bool Reap(UMockdevIoctlClient* client, UMockdevIoctlData* argument,
            std::unique_lock<std::mutex>& lock) {
    if (done.empty()) changed.wait_for(lock, kReapWait);
    if (done.empty()) return Complete(client, -1, gone ? ENODEV : EAGAIN);
    UMockdevIoctlData* slot = umockdev_ioctl_data_resolve(argument, 0, sizeof(gpointer), nullptr);
    if (slot == nullptr) return Complete(client, -1, EFAULT);
    const Transfer transfer = done.front();
    done.pop_front();
    umockdev_ioctl_data_set_ptr(slot, 0, transfer.urb);
    Complete(client, 0, 0);
    g_object_unref(slot);
    g_object_unref(transfer.buffer);
    g_object_unref(transfer.urb);
    return true;
  }

  bool Discard(UMockdevIoctlClient* client, UMockdevIoctlData* argument) {
    gulong address = 0;
    std::memcpy(&address, argument->data, sizeof address);
    for (auto* waiting : {&polls, &unanswered}) {
      for (auto at = waiting->begin(); at != waiting->end(); ++at) {
        if (at->urb->client_addr != address) continue;
        at->End(-ENOENT, 0);
        Finish(*at);
        waiting->erase(at);
        return Complete(client, 0, 0);
      }
    }
    return Complete(client, -1, EINVAL);
  }

  // From here on no function of the script is called, because its test may be over.
  void Vanish() {
    const std::lock_guard lock(mutex);
    gone = true;
    EndTransfers();
  }

  void EndTransfers() {
    for (auto* waiting : {&polls, &unanswered}) {
      for (const Transfer& transfer : *waiting) {
        transfer.End(-ESHUTDOWN, 0);
        Finish(transfer);
      }
      waiting->clear();
    }
  }

  UsbDeviceScript script;
  std::mutex mutex;
  std::condition_variable changed;
  std::deque<InputStep> steps;
  std::list<Transfer> polls;       // interrupt transfers in flight
  std::list<Transfer> unanswered;  // control transfers without an answer in the script
  std::deque<Transfer> done;
  bool gone = false;
  bool claimed = false;
  int cleared_halts = 0;
};

struct UsbTestbed::State {
  std::unique_ptr<UMockdevTestbed, decltype(&g_object_unref)> owner{emulator::NewMockedMachine(),
                                                                    &g_object_unref};
  UMockdevTestbed* testbed = owner.get();
  emulator::AnsweredFiles files{testbed};
  std::map<int, std::shared_ptr<Device>> plugged;
};

UsbTestbed::UsbTestbed() : state_(std::make_unique<State>()) {}

UsbTestbed::~UsbTestbed() {
  for (const auto& [address, device] : state_->plugged) device->Vanish();
}

std::string UsbTestbed::Root() const {
  char* root = umockdev_testbed_get_root_dir(state_->testbed);
  std::string path = root;
  g_free(root);
  return path;
}

void UsbTestbed::Plug(int address, const UsbDeviceScript& script) {
  const auto device = std::make_shared<Device>(script);
  state_->plugged[address] = device;
  const std::string number = std::to_string(address);
  char padded[8];
  std::snprintf(padded, sizeof padded, "%03d", address);
  state_->files.Attach(NodePath(address), device);
  const std::string description =
      "P: " + DevicePath(address) + "\nN: bus/usb/001/" + padded +
      "\nE: SUBSYSTEM=usb\nE: DRIVER=usb\nE: BUSNUM=001\nE: DEVNUM=" + padded +
      "\nE: DEVNAME=" + NodePath(address) +
      "\nE: DEVTYPE=usb_device\nA: bConfigurationValue=1\\n\nA: busnum=1\\n\nA: devnum=" + number +
      "\\n\nA: product=" + script.product + "\\n\nA: serial=" + script.serial +
      "\\n\nA: speed=12\\n\nH: descriptors=" + DescriptorsInHex(script) + "\n";
  GError* error = nullptr;
  // Also announces the device.
  umockdev_testbed_add_from_string(state_->testbed, description.c_str(), &error);
  Check(error, "add_from_string");
}

void UsbTestbed::Unplug(int address, bool announce) {
  At(address).Vanish();
  if (!announce) return;
  const std::string path = "/sys" + DevicePath(address);
  umockdev_testbed_uevent(state_->testbed, path.c_str(), "remove");
  umockdev_testbed_remove_device(state_->testbed, path.c_str());
  state_->plugged.erase(address);
}

void UsbTestbed::Input(int address, const InputStep& step) {
  Device& device = At(address);
  const std::lock_guard lock(device.mutex);
  device.steps.push_back(step);
  device.Play();
}

void UsbTestbed::Lose(int address) {
  Device& device = At(address);
  const std::lock_guard lock(device.mutex);
  device.EndTransfers();
}

UsbTestbed::Device& UsbTestbed::At(int address) const { return *state_->plugged.at(address); }

int UsbTestbed::ClearedHalts(int address) const {
  Device& device = At(address);
  const std::lock_guard lock(device.mutex);
  return device.cleared_halts;
}

bool UsbTestbed::Claimed(int address) const {
  Device& device = At(address);
  const std::lock_guard lock(device.mutex);
  return device.claimed;
}

int UsbTestbed::TransfersWaiting(int address) const {
  Device& device = At(address);
  const std::lock_guard lock(device.mutex);
  return static_cast<int>(device.polls.size());
}

}  // namespace torquer::test
