#include "host/emulator/umockdev_front.h"

#include <umockdev.h>

#include <algorithm>
#include <cerrno>
#include <chrono>
#include <cstdio>
#include <memory>
#include <mutex>
#include <span>
#include <stdexcept>
#include <utility>
#include <vector>

#include "host/emulator/umockdev_handler.h"
#include "host/emulator/umockdev_machine.h"
#include "host/emulator/usbfs_node.h"
#include "host/support/error.h"

namespace torquer::emulator {
namespace {

constexpr auto kFrame = std::chrono::milliseconds(1);
// Longest wait of a frame for the IN transfer of a program that has claimed the interface. A busy
// machine delays a program less; a program that hangs is not waited for.
constexpr auto kLongestFrame = std::chrono::seconds(20);
constexpr SetupPacket kClearHalt{0x02, 1, 0, 0x81, 0};
constexpr int kAddressesAPort = 14;

// Held while a device is put on the mocked machine or taken off it.
std::mutex machine_mutex;

// Mocked machine, the only one of the process. It exists as long as a bench does.
std::shared_ptr<UMockdevTestbed> Machine() {
  static std::weak_ptr<UMockdevTestbed> machine;
  const std::lock_guard lock(machine_mutex);
  std::shared_ptr<UMockdevTestbed> shared = machine.lock();
  if (!shared) {
    shared.reset(NewMockedMachine(), [](UMockdevTestbed* testbed) { g_object_unref(testbed); });
    machine = shared;
  }
  return shared;
}

}  // namespace

/// The mocked bus with one device or none. It connects the device's file with the host model. The
/// bench's mutex is held in all calls but those marked otherwise.
class UmockdevBench::Bus {
 public:
  Bus(UsbHost& host, int port)
      : host_(host), machine_(Machine()), testbed_(machine_.get()), files_(testbed_), port_(port) {
    if (!umockdev_in_mock_environment()) {
      throw UserError(
          "the device can be mocked only under umockdev: run the program as "
          "`umockdev-wrapper PROGRAM` (package umockdev)");
    }
    host_.wants_input = [this] { return node_ && node_->WantsInput(); };
    host_.on_input = [this](const std::vector<std::uint8_t>& report) { Deliver(report); };
    host_.on_input_stall = [this] {
      if (node_) node_->EndInput(-EPIPE, {});
    };
  }

  ~Bus() {
    if (node_) Remove();
  }

  /// Makes the file that programs find. The device must be enumerated.
  void Add() {
    const std::lock_guard lock(machine_mutex);
    // A number that the bus has not used lately, as the kernel gives them.
    number_ = number_ % kAddressesAPort + 1;
    const int address = (port_ - 1) * kAddressesAPort + 1 + number_;
    char number[16];
    std::snprintf(number, sizeof(number), "%03d", address);
    path_ = std::string("/dev/bus/usb/001/").append(number);
    node_ = std::make_shared<UsbfsNode>();
    files_.Attach(path_, node_);

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
        std::string("P: /devices/usb1/1-")
            .append(std::to_string(port_))
            .append("\nN: bus/usb/001/")
            .append(number)
            .append("\nE: SUBSYSTEM=usb\nE: DEVTYPE=usb_device\nE: BUSNUM=001\nE: DEVNUM=")
            .append(number)
            .append("\nE: DEVNAME=")
            .append(path_)
            .append("\nA: bConfigurationValue=1\\n\nA: busnum=1\\n\nA: devnum=")
            .append(std::to_string(address))
            .append("\\n\nA: speed=12\\n\n")
            .append(ids)
            .append("A: serial=")
            .append(device.serial)
            .append("\\n\nH: descriptors=")
            .append(descriptors)
            .append("\n");
    GError* error = nullptr;
    umockdev_testbed_add_from_string(testbed_, record.c_str(), &error);
    if (error) {
      const std::string message = error->message;
      g_error_free(error);
      throw std::runtime_error("umockdev: " + message);
    }
  }

  void Remove() {
    const std::lock_guard lock(machine_mutex);
    const std::string system_path = "/sys/devices/usb1/1-" + std::to_string(port_);
    umockdev_testbed_uevent(testbed_, system_path.c_str(), "remove");
    node_->Vanish();
    node_.reset();
    umockdev_testbed_remove_device(testbed_, system_path.c_str());
  }

  /// Null while the device is off the bus.
  std::shared_ptr<UsbfsNode> node() const { return node_; }

  /// Passes the requests of programs to the host model.
  void Service() {
    if (!node_) return;
    while (!hang_control) {
      auto control = node_->TakeControl();
      if (!control) break;
      const SetupPacket setup = control->setup;
      host_.Submit(setup, std::move(control->data),
                   [node = node_, id = control->id, setup](const ControlResult& result) {
                     const bool to_host = setup.type & 0x80;
                     node->EndControl(id, StatusOf(result.status), result.data,
                                      to_host
                                          ? std::min<std::size_t>(result.data.size(), setup.length)
                                          : setup.length);
                   });
    }
    if (node_->TakeClearHalt()) {
      host_.Submit(kClearHalt, {}, [node = node_](const ControlResult&) { node->EndClearHalt(); });
    }
  }

  // From any thread.
  std::atomic<int> shorten_to{-1};  ///< bytes of the next input; none if negative
  std::atomic<std::shared_ptr<const std::vector<std::uint8_t>>> replacement;
  std::atomic<bool> stall_next{false};
  std::atomic<bool> hang_control{false};
  std::atomic<std::int64_t> delivered{0};

 private:
  void Deliver(const std::vector<std::uint8_t>& report) {
    if (!node_) return;
    if (stall_next.exchange(false)) {
      node_->EndInput(-EPIPE, {});
      return;
    }
    std::span<const std::uint8_t> bytes(report);
    const auto replaced = replacement.exchange(nullptr);
    if (replaced) bytes = *replaced;
    if (const int size = shorten_to.exchange(-1); size >= 0) {
      bytes = bytes.first(std::min(bytes.size(), static_cast<std::size_t>(size)));
    }
    if (node_->EndInput(0, bytes)) ++delivered;
  }

  UsbHost& host_;
  std::shared_ptr<UMockdevTestbed> machine_;
  UMockdevTestbed* testbed_;
  AnsweredFiles files_;
  int port_;
  std::shared_ptr<UsbfsNode> node_;
  std::string path_;
  int number_ = 0;
};

UmockdevBench::UmockdevBench(const FirmwareImage& image, const BenchOptions& options,
                             std::function<HandState(double)> hand, int port)
    : device_(image, options), host_(device_), bus_(std::make_unique<Bus>(host_, port)) {
  device_.SetHand(std::move(hand));
  Plug();
  thread_ = std::thread([this] { Run(); });
}

UmockdevBench::~UmockdevBench() {
  stop_ = true;
  std::shared_ptr<UsbfsNode> node;
  {
    const std::lock_guard lock(device_mutex_);
    node = bus_->node();
  }
  if (node) node->StopWaiting();
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
  if (bus_->node()) bus_->Remove();
}

void UmockdevBench::Do(const std::function<void(BenchDevice&, UsbHost&)>& action) {
  const std::lock_guard lock(device_mutex_);
  action(device_, host_);
}

void UmockdevBench::ShortenNextInput(std::size_t bytes) {
  bus_->shorten_to = static_cast<int>(bytes);
}
void UmockdevBench::ReplaceNextInput(std::vector<std::uint8_t> bytes) {
  bus_->replacement = std::make_shared<const std::vector<std::uint8_t>>(std::move(bytes));
}
void UmockdevBench::StallNextInput() { bus_->stall_next = true; }
void UmockdevBench::HangControl(bool hang) { bus_->hang_control = hang; }
std::int64_t UmockdevBench::inputs_delivered() const { return bus_->delivered; }

void UmockdevBench::Run() {
  auto next_frame = std::chrono::steady_clock::now();
  while (!stop_) {
    std::this_thread::sleep_until(next_frame);
    std::shared_ptr<UsbfsNode> node;
    {
      const std::lock_guard lock(device_mutex_);
      node = bus_->node();
    }
    if (node) node->WaitForProgram(kLongestFrame);
    {
      const std::lock_guard lock(device_mutex_);
      bus_->Service();
      host_.RunFrame();
      // A reset of the device by itself: it leaves the bus and comes back.
      if (bus_->node() && !host_.ready()) bus_->Remove();
      if (!bus_->node() && host_.ready()) bus_->Add();
    }
    next_frame = std::max(next_frame + kFrame, std::chrono::steady_clock::now() - kFrame);
  }
}

}  // namespace torquer::emulator
