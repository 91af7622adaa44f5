#include "host/tools/usb_boards.h"

#include <libusb.h>

#include <algorithm>
#include <array>
#include <chrono>
#include <filesystem>
#include <thread>
#include <utility>

#include "host/support/error.h"
#include "protocol/usb_ids.h"

namespace torquer::tools {
namespace {

constexpr int kInterface = 0;
constexpr unsigned kControlTimeoutMs = 5000;
constexpr std::uint8_t kGetReport = 0x01;  // HID 1.11, 7.2
constexpr std::uint8_t kSetReport = 0x09;
constexpr std::uint16_t kFeatureReport = 0x0300;

// It is coming or going, perhaps.
constexpr char kSilent[] =
    "it does not answer; unplug it, plug it in and run the same command again";
constexpr char kPermission[] =
    "it may not be opened by this user; install the udev rule: sudo cp "
    "hardware/udev/70-torquer.rules /etc/udev/rules.d/ && sudo udevadm control --reload && sudo "
    "udevadm trigger";

struct KnownBoard {
  std::uint16_t vendor, product;
  BoardMode mode;
  int clock_mhz;
  const char* name;  // the product string that ours must have; of the others it is not asked
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

// libusb at one moment: a board changes its place in libusb's lists with each of its modes, and
// hears of that only where udev runs, so that looking anew is the surest way.
class Usb {
 public:
  Usb() {
    const int error = libusb_init(&context_);
    if (error != 0) {
      throw UserError(std::string("the USB cannot be used: ") + libusb_strerror(error) +
                      "; is /dev/bus/usb there?");
    }
    count_ = libusb_get_device_list(context_, &list_);
  }
  ~Usb() {
    if (list_) libusb_free_device_list(list_, 1);
    libusb_exit(context_);
  }
  Usb(const Usb&) = delete;
  Usb& operator=(const Usb&) = delete;

  template <typename Visit>
  void ForEach(Visit visit) const {
    for (ssize_t i = 0; i < count_; ++i) {
      libusb_device_descriptor descriptor{};
      if (libusb_get_device_descriptor(list_[i], &descriptor) != 0) continue;
      const auto* known = std::find_if(
          std::begin(kKnownBoards), std::end(kKnownBoards), [&](const KnownBoard& each) {
            return each.vendor == descriptor.idVendor && each.product == descriptor.idProduct;
          });
      if (known != std::end(kKnownBoards)) visit(list_[i], descriptor, *known);
    }
  }

 private:
  libusb_context* context_ = nullptr;
  libusb_device** list_ = nullptr;
  ssize_t count_ = 0;
};

// As the kernel names it.
std::string PlaceOf(libusb_device* device) {
  std::array<std::uint8_t, 8> ports{};
  const int depth = libusb_get_port_numbers(device, ports.data(), static_cast<int>(ports.size()));
  std::string place = std::to_string(libusb_get_bus_number(device));
  for (int i = 0; i < depth; ++i) {
    place += (i == 0 ? "-" : ".") + std::to_string(ports[static_cast<std::size_t>(i)]);
  }
  return place;
}

std::string StringOf(libusb_device_handle* handle, std::uint8_t index) {
  std::array<unsigned char, 128> text{};
  const int length = index == 0 ? 0
                                : libusb_get_string_descriptor_ascii(handle, index, text.data(),
                                                                     static_cast<int>(text.size()));
  return {reinterpret_cast<const char*>(text.data()),
          static_cast<std::size_t>(std::max(length, 0))};
}

// The serial port that the kernel made of a device; empty if it has not yet.
std::string SerialPortAt(const std::string& place) {
  std::error_code error;
  const std::string interface = "/sys/bus/usb/devices/" + place + ":1.0/tty";
  for (const auto& entry : std::filesystem::directory_iterator(interface, error)) {
    return "/dev/" + entry.path().filename().string();
  }
  return {};
}

class UsbLink final : public FeatureLink {
 public:
  UsbLink(std::unique_ptr<Usb> usb, libusb_device* device, const std::string& place)
      : usb_(std::move(usb)) {
    const int opened = libusb_open(device, &handle_);
    if (opened == LIBUSB_ERROR_ACCESS) throw UserError("USB " + place + ": " + kPermission);
    if (opened != 0) throw BoardLost(libusb_strerror(opened));
    libusb_set_auto_detach_kernel_driver(handle_, 1);
    const int claimed = libusb_claim_interface(handle_, kInterface);
    if (claimed == 0) return;
    libusb_close(handle_);
    if (claimed == LIBUSB_ERROR_BUSY) {
      throw UserError("USB " + place +
                      ": another program uses the board; stop it, torquer-daemon perhaps, and run "
                      "the same command again");
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
      throw ReportRefused("report " + std::to_string(report_id) + " was stalled");
    }
    if (result < 0) throw BoardLost(libusb_strerror(result));
    return result;
  }

  std::unique_ptr<Usb> usb_;
  libusb_device_handle* handle_ = nullptr;
};

}  // namespace

std::vector<Board> UsbBoards::List() {
  std::vector<Board> boards;
  const Usb usb;
  usb.ForEach([&](libusb_device* device, const libusb_device_descriptor& descriptor,
                  const KnownBoard& known) {
    Board board;
    board.mode = known.mode;
    board.place = PlaceOf(device);
    board.clock_mhz = known.clock_mhz;
    if (known.mode == BoardMode::kCaterina) board.port = SerialPortAt(board.place);
    if (known.name) {
      libusb_device_handle* handle = nullptr;
      const int opened = libusb_open(device, &handle);
      if (opened == 0) {
        const std::string product = StringOf(handle, descriptor.iProduct);
        board.serial = StringOf(handle, descriptor.iSerialNumber);
        libusb_close(handle);
        if (product.empty() && descriptor.iProduct != 0) {
          board.trouble = kSilent;
        } else if (product != known.name) {
          return;  // the ids are shared with other people's prototypes
        }
      } else {
        board.trouble = opened == LIBUSB_ERROR_ACCESS ? kPermission : kSilent;
      }
    }
    boards.push_back(std::move(board));
  });
  return boards;
}

std::unique_ptr<FeatureLink> UsbBoards::Open(const Board& board) {
  auto usb = std::make_unique<Usb>();
  libusb_device* wanted = nullptr;
  usb->ForEach(
      [&](libusb_device* device, const libusb_device_descriptor&, const KnownBoard& known) {
        if (known.mode == board.mode && PlaceOf(device) == board.place) wanted = device;
      });
  if (!wanted) throw BoardLost("it is not on the bus");
  return std::make_unique<UsbLink>(std::move(usb), wanted, board.place);
}

void UsbBoards::Sleep(int milliseconds) {
  std::this_thread::sleep_for(std::chrono::milliseconds(milliseconds));
}

}  // namespace torquer::tools
