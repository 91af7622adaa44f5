#include "host/tools/usb_boards.h"

#include <fmt/format.h>
#include <libusb.h>

#include <algorithm>
#include <array>
#include <chrono>
#include <filesystem>
#include <thread>
#include <utility>

#include "host/device/usb.h"
#include "host/support/error.h"
#include "protocol/usb_ids.h"

namespace torquer::tools {
namespace {

constexpr int kInterface = 0;
constexpr unsigned kControlTimeoutMs = 5000;
constexpr std::uint8_t kGetReport = 0x01;  // HID 1.11, 7.2
constexpr std::uint8_t kSetReport = 0x09;
constexpr std::uint16_t kFeatureReport = 0x0300;

// The board may be starting or disconnecting.
constexpr char kSilent[] =
    "it does not answer; unplug it, plug it in and run the same command again";

std::string NoPermission() {
  return fmt::format("it may not be opened by this user; {}", device::kPermissionRemedy);
}

struct KnownBoard {
  std::uint16_t vendor, product;
  BoardMode mode;
  int crystal_mhz;
  const char* name;  // product string required for our boards; null: any
};
constexpr KnownBoard kKnownBoards[] = {
    {protocol::kUsbVendorId, protocol::kUsbProductId, BoardMode::kFirmware, 0,
     protocol::kUsbProduct},
    {protocol::kUsbVendorId, protocol::kUsbBootloaderProductId, BoardMode::kBootloader, 0,
     protocol::kUsbBootloaderProduct},
    {0x2341, 0x0036, BoardMode::kCaterina, 16, nullptr},  // Leonardo
    {0x2a03, 0x0036, BoardMode::kCaterina, 16, nullptr},
    {0x2341, 0x0037, BoardMode::kCaterina, 16, nullptr},  // Micro
    {0x2a03, 0x0037, BoardMode::kCaterina, 16, nullptr},
    {0x1b4f, 0x9205, BoardMode::kCaterina, 16, nullptr},  // Pro Micro 5 V
    {0x1b4f, 0x9203, BoardMode::kCaterina, 8, nullptr},   // Pro Micro 3.3 V
    {0x2341, 0x8036, BoardMode::kSketch, 16, nullptr},
    {0x2a03, 0x8036, BoardMode::kSketch, 16, nullptr},
    {0x2341, 0x8037, BoardMode::kSketch, 16, nullptr},
    {0x2a03, 0x8037, BoardMode::kSketch, 16, nullptr},
    {0x1b4f, 0x9206, BoardMode::kSketch, 16, nullptr},
    {0x1b4f, 0x9204, BoardMode::kSketch, 8, nullptr},
    {0x03eb, 0x2ff4, BoardMode::kDfu, 0, nullptr},
};

// Calls `visit` for each known board in `usb`.
template <typename Visit>
void ForEachBoard(const device::UsbDevices& usb, Visit visit) {
  usb.ForEach([&](libusb_device* device, const libusb_device_descriptor& descriptor) {
    const auto* known =
        std::find_if(std::begin(kKnownBoards), std::end(kKnownBoards), [&](const KnownBoard& each) {
          return each.vendor == descriptor.idVendor && each.product == descriptor.idProduct;
        });
    if (known != std::end(kKnownBoards)) visit(device, descriptor, *known);
  });
}

// USB port name in the kernel's format.
std::string PlaceOf(libusb_device* device) {
  std::array<std::uint8_t, 8> ports{};
  const int depth = libusb_get_port_numbers(device, ports.data(), static_cast<int>(ports.size()));
  std::string place = fmt::to_string(libusb_get_bus_number(device));
  for (int i = 0; i < depth; ++i) {
    place += fmt::format("{}{}", i == 0 ? '-' : '.', ports[static_cast<std::size_t>(i)]);
  }
  return place;
}

// Serial port that the kernel created for a device; empty if not yet.
std::string SerialPortAt(const std::string& place) {
  std::error_code error;
  const std::string interface = fmt::format("/sys/bus/usb/devices/{}:1.0/tty", place);
  for (const auto& entry : std::filesystem::directory_iterator(interface, error)) {
    return "/dev/" + entry.path().filename().string();
  }
  return {};
}

class UsbLink final : public FeatureLink {
 public:
  UsbLink(std::unique_ptr<device::UsbDevices> usb, libusb_device* device, const std::string& place)
      : usb_(std::move(usb)) {
    const int opened = libusb_open(device, &handle_);
    if (opened == LIBUSB_ERROR_ACCESS)
      throw UserError(fmt::format("USB {}: {}", place, NoPermission()));
    if (opened != 0) throw BoardLost(libusb_strerror(opened));
    libusb_set_auto_detach_kernel_driver(handle_, 1);
    const int claimed = libusb_claim_interface(handle_, kInterface);
    if (claimed == 0) return;
    libusb_close(handle_);
    if (claimed == LIBUSB_ERROR_BUSY) {
      throw UserError(
          fmt::format("USB {}: another program uses the board, perhaps torquer-daemon; stop it and "
                      "run the same command again",
                      place));
    }
    throw BoardLost(libusb_strerror(claimed));
  }
  ~UsbLink() override {
    libusb_release_interface(handle_, kInterface);
    libusb_close(handle_);
  }
  UsbLink(const UsbLink&) = delete;
  UsbLink& operator=(const UsbLink&) = delete;

  std::vector<std::uint8_t> Get(std::uint8_t report_id, std::size_t size) override {
    std::vector<std::uint8_t> report(size);
    const int taken = Transfer(LIBUSB_ENDPOINT_IN, kGetReport, report_id, report);
    report.resize(static_cast<std::size_t>(taken));
    return report;
  }
  void Set(std::span<const std::uint8_t> report) override {
    std::vector<std::uint8_t> bytes(report.begin(), report.end());
    Transfer(LIBUSB_ENDPOINT_OUT, kSetReport, bytes.front(), bytes);
  }

 private:
  int Transfer(std::uint8_t direction, std::uint8_t request, std::uint8_t report_id,
               std::vector<std::uint8_t>& bytes) {
    const int result = libusb_control_transfer(
        handle_, direction | LIBUSB_REQUEST_TYPE_CLASS | LIBUSB_RECIPIENT_INTERFACE, request,
        kFeatureReport | report_id, kInterface, bytes.data(),
        static_cast<std::uint16_t>(bytes.size()), kControlTimeoutMs);
    if (result == LIBUSB_ERROR_PIPE) {
      throw ReportRefused(fmt::format("report {} was stalled", report_id));
    }
    if (result < 0) throw BoardLost(libusb_strerror(result));
    return result;
  }

  std::unique_ptr<device::UsbDevices> usb_;
  libusb_device_handle* handle_ = nullptr;
};

}  // namespace

std::vector<Board> UsbBoards::List() {
  std::vector<Board> boards;
  const device::UsbDevices usb;
  ForEachBoard(usb, [&](libusb_device* device, const libusb_device_descriptor& descriptor,
                        const KnownBoard& known) {
    Board board;
    board.mode = known.mode;
    board.place = PlaceOf(device);
    board.crystal_mhz = known.crystal_mhz;
    if (known.mode == BoardMode::kCaterina || known.mode == BoardMode::kSketch)
      board.port = SerialPortAt(board.place);
    if (known.name) {
      libusb_device_handle* handle = nullptr;
      const int opened = libusb_open(device, &handle);
      if (opened == 0) {
        const std::string product = device::UsbText(handle, descriptor.iProduct);
        board.serial = device::UsbText(handle, descriptor.iSerialNumber);
        libusb_close(handle);
        if (product.empty() && descriptor.iProduct != 0) {
          board.problem = kSilent;
        } else if (product != known.name) {
          return;  // other people's prototypes use the same ids
        }
      } else {
        board.problem = opened == LIBUSB_ERROR_ACCESS ? NoPermission() : kSilent;
      }
    }
    boards.push_back(std::move(board));
  });
  return boards;
}

std::unique_ptr<FeatureLink> UsbBoards::Open(const Board& board) {
  auto usb = std::make_unique<device::UsbDevices>();
  libusb_device* wanted = nullptr;
  ForEachBoard(
      *usb, [&](libusb_device* device, const libusb_device_descriptor&, const KnownBoard& known) {
        if (known.mode == board.mode && PlaceOf(device) == board.place) wanted = device;
      });
  if (!wanted) throw BoardLost("it is not on the bus");
  return std::make_unique<UsbLink>(std::move(usb), wanted, board.place);
}

void UsbBoards::Sleep(int milliseconds) {
  std::this_thread::sleep_for(std::chrono::milliseconds(milliseconds));
}

}  // namespace torquer::tools
