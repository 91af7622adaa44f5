// Fuzz test of control requests to the firmware in the emulator, completed or aborted at any stage.
// After each one, the next request is served, reports continue, and no count is lost.
#include <algorithm>
#include <array>
#include <random>

#include "protocol/usb_ids.h"
#include "tests/support/emulated_bench.h"
#include "tests/support/sanitizer.h"

namespace torquer::emulator {
namespace {

constexpr int kShare = test::kUnderSanitizer ? 16 : 1;  // runs one request of this many

constexpr std::uint16_t kValues[] = {
    0,      1,      2,      3,      4,      0x7f,   0x80,   0x81,   0x0100, 0x0101, 0x0200, 0x0201,
    0x0300, 0x0301, 0x0302, 0x0303, 0x0304, 0x0305, 0x0600, 0x2100, 0x2200, 0x2300, 0x7fff, 0xffff};
constexpr std::uint16_t kIndices[] = {0, 1, 2, 0x80, 0x81, 0x82, 0x0101, 0x0409, 0xffff};
constexpr std::uint16_t kLengths[] = {0,  1,  2,  7,  8,  9,  16,  18,    31,
                                      32, 33, 34, 63, 64, 65, 255, 0x100, 0xffff};

// Stage at which the host aborts, or its error.
enum class Course {
  kWhole,
  kSetupOnly,
  kOnePacket,
  kNoStatus,
  kEarlyStatus,
  kWrongDirection,
  kTooLong,
};
constexpr int kCourses = 7;

// Host that sends random requests. It runs the bus packet by packet.
class WildHost {
 public:
  /// `patience` is the number of slots for which it repeats a packet.
  explicit WildHost(int patience = 50) : patience_(patience) {
    device_.SetHand([](double time_s) {
      HandState hand;
      hand.insertion_mm = 30 * time_s;
      hand.rotation_rad = -time_s;
      return hand;
    });
    for (int i = 0; i < 600; ++i) Frame();  // the firmware checks its flash first
    REQUIRE(device_.usb().Attached());
    Attach();
    // Runs until the sensor counts.
    for (int i = 0; i < 300; ++i) Frame();
    REQUIRE(reports_ > 250);
    REQUIRE_FALSE(last_.flags & protocol::kFlagSensorFault);
  }

  void Send(const SetupPacket& setup, Course course) {
    const bool to_host = setup.type & 0x80;
    REQUIRE(Setup(setup));
    if (course == Course::kSetupOnly) return Pass(static_cast<int>(random_() % 4));
    const bool in = course == Course::kWrongDirection ? !to_host : to_host;
    std::size_t left = std::min<std::size_t>(setup.length, kLongest);
    if (course == Course::kTooLong && !in) left += 40;
    bool refused = false;
    for (int packets = 0; left > 0 && !refused; ++packets) {
      if (course == Course::kOnePacket && packets == 1) return;
      if (course == Course::kEarlyStatus && packets == 1) break;
      Bytes packet;
      const UsbAnswer answer = in ? In(&packet) : Out(Data(setup, left));
      refused = answer != UsbAnswer::kAck;
      const std::size_t size = in ? packet.size() : std::min<std::size_t>(left, 32);
      left -= std::min(left, size);
      if (in && packet.size() < 32) break;
    }
    if (course == Course::kNoStatus || refused) return;
    Bytes nothing;
    (in && setup.length != 0) ? Out({}) : In(&nothing);
  }

  // Checks that the device serves the simplest request, and restores settings that the fuzzer
  // changed.
  void Recover(std::uint16_t perhaps_address) {
    Bytes configuration;
    if (!Get({0x80, 8, 0, 0, 1}, &configuration)) {
      address_ = static_cast<std::uint8_t>(perhaps_address);
      REQUIRE(perhaps_address <= 127);
      REQUIRE(Get({0x80, 8, 0, 0, 1}, &configuration));
    }
    REQUIRE(configuration.size() == 1);
    REQUIRE(configuration[0] <= 1);
    if (configuration[0] == 0) {
      Attach();
    } else {
      Bytes status;
      REQUIRE(Get({0x82, 0, 0, 0x81, 2}, &status));
      if (status.at(0) == 1) Tell({0x02, 1, 0, 0x81, 0});
    }
    if (++recoveries_ % 8 != 0 || patience_ > kShortPatience) return;
    const int before = reports_;
    Frame();
    Frame();
    REQUIRE(reports_ > before);
  }

  // Checks that the reports contain the sensor's counts and that no report is missing.
  void Check() {
    for (int i = 0; i < 5 || ((last_.flags & protocol::kFlagSensorFault) && i < 1000); ++i) Frame();
    CHECK(gaps_ == 0);
    CHECK(last_.boot_id == 0);
    CHECK(device_.chip().resets() == 0);
    CHECK_FALSE(last_.flags & protocol::kFlagSensorFault);
    // A poll returns the report of the previous frame.
    const auto axial = static_cast<std::int32_t>(device_.sensor().axial_counts());
    CHECK(std::abs(last_.axial_counts - axial) <= 15);
    CHECK(last_.axial_counts > 100);
    for (const std::string& violation : device_.Violations()) FAIL_CHECK(violation);
  }

  std::mt19937& random() { return random_; }

  void Pass(int slots) {
    for (int i = 0; i < slots; ++i) Slot();
  }

 private:
  using Bytes = std::vector<std::uint8_t>;
  static constexpr double kSlotUs = 40;
  static constexpr int kShortPatience = 50;
  static constexpr std::size_t kLongest = 5000;

  // Runs the next slot of the frame; after its last slot the next frame begins.
  void Slot() {
    device_.chip().UpdateUsbInterrupts();
    device_.RunUntil(device_.now_us() + kSlotUs);
    if (device_.now_us() >= frame_end_us_) BeginFrame();
  }
  void Frame() {
    device_.chip().UpdateUsbInterrupts();
    device_.RunUntil(frame_end_us_);
    BeginFrame();
  }
  void BeginFrame() {
    frame_end_us_ += BenchDevice::kFrameUs;
    device_.usb().StartOfFrame(++frame_ & 0x7ff);
    Bytes packet;
    if (device_.usb().In(address_, protocol::kInputEndpoint, &packet) == UsbAnswer::kAck) {
      REQUIRE(packet.size() == sizeof(last_));
      const std::uint16_t expected = static_cast<std::uint16_t>(last_.sequence + 1);
      std::memcpy(&last_, packet.data(), sizeof(last_));
      // After a time without polls, only the newest report is available.
      if (polled_ && last_.sequence != expected) ++gaps_;
      polled_ = true;
      ++reports_;
    } else {
      polled_ = false;
    }
    device_.chip().UpdateUsbInterrupts();
  }

  void Attach() {
    if (reports_ == 0) {
      device_.usb().BusReset();
      address_ = 0;
      Frame();
    }
    Tell({0x00, 9, 1, 0, 0});
  }

  bool Setup(const SetupPacket& setup) {
    const std::array<std::uint8_t, 8> packet{setup.type,
                                             setup.request,
                                             static_cast<std::uint8_t>(setup.value),
                                             static_cast<std::uint8_t>(setup.value >> 8),
                                             static_cast<std::uint8_t>(setup.index),
                                             static_cast<std::uint8_t>(setup.index >> 8),
                                             static_cast<std::uint8_t>(setup.length),
                                             static_cast<std::uint8_t>(setup.length >> 8)};
    const UsbAnswer answer = device_.usb().Setup(address_, packet);
    Slot();
    return answer == UsbAnswer::kAck;
  }
  // The device may be busy for at most a frame or two.
  template <typename Try>
  UsbAnswer UntilAnswered(const Try& once) {
    UsbAnswer answer = UsbAnswer::kNak;
    for (int i = 0; i < patience_ && answer == UsbAnswer::kNak; ++i) {
      answer = once();
      Slot();
    }
    return answer;
  }
  UsbAnswer In(Bytes* packet) {
    return UntilAnswered([&] { return device_.usb().In(address_, 0, packet); });
  }
  UsbAnswer Out(const Bytes& packet) {
    return UntilAnswered([&] { return device_.usb().Out(address_, 0, packet); });
  }
  Bytes Data(const SetupPacket& setup, std::size_t left) {
    Bytes bytes(std::min<std::size_t>(left, 32));
    for (std::uint8_t& byte : bytes) byte = static_cast<std::uint8_t>(random_());
    if (random_() % 2) bytes[0] = static_cast<std::uint8_t>(setup.value);
    if (bytes.size() > 1 && random_() % 2) bytes[1] = protocol::kProtocolVersion;
    // Random data must not contain the command key, which would zero the counts or restart the
    // device.
    if (bytes.size() > 2 && bytes[2] == (protocol::kCommandKey & 0xff)) ++bytes[2];
    return bytes;
  }
  bool Get(const SetupPacket& setup, Bytes* data) {
    if (!Setup(setup)) return false;
    if (In(data) != UsbAnswer::kAck) return false;
    return Out({}) == UsbAnswer::kAck;
  }
  void Tell(const SetupPacket& setup) {
    REQUIRE(Setup(setup));
    Bytes nothing;
    REQUIRE(In(&nothing) == UsbAnswer::kAck);
  }

  BenchDevice device_{Image16(), {}};
  std::mt19937 random_{20};
  double frame_end_us_ = BenchDevice::kFrameUs;
  unsigned frame_ = 0;
  std::uint8_t address_ = 0;
  protocol::InputReport last_{};
  int patience_;
  bool polled_ = false;
  int reports_ = 0;
  int gaps_ = 0;
  int recoveries_ = 0;
};

template <std::size_t kCount>
std::uint16_t OneOf(const std::uint16_t (&list)[kCount], std::mt19937& random) {
  return random() % 8 == 0 ? static_cast<std::uint16_t>(random()) : list[random() % kCount];
}

void SendOne(WildHost* host, int type, int request) {
  std::mt19937& random = host->random();
  const SetupPacket setup{static_cast<std::uint8_t>(type), static_cast<std::uint8_t>(request),
                          OneOf(kValues, random), OneOf(kIndices, random), OneOf(kLengths, random)};
  const auto course = static_cast<Course>(random() % kCourses);
  INFO("bmRequestType " << type << " bRequest " << request << " wValue " << setup.value
                        << " wIndex " << setup.index << " wLength " << setup.length << " course "
                        << static_cast<int>(course));
  host->Send(setup, course);
  host->Recover(setup.value);
}

TEST_CASE("no request of any type and value blocks the device") {
  WildHost host;
  for (int pair = 0; pair < 0x10000; pair += kShare) {
    SendOne(&host, pair >> 8, (pair & 0xff) ^ (kShare > 1 ? pair >> 12 : 0));
  }
  host.Check();
}

TEST_CASE("the requests that mean something, with every value and left at every stage") {
  WildHost host;
  constexpr int kTypes[] = {0x00, 0x01, 0x02, 0x80, 0x81, 0x82, 0x21, 0xa1};
  for (int i = 0; i < 50000 / kShare; ++i) {
    const int type = kTypes[host.random()() % std::size(kTypes)];
    SendOne(&host, type, static_cast<int>(host.random()() % 13));
  }
  host.Check();
}

// Long reports: a firmware image for the sensor, of correct or wrong length, and its picture.
// Aborted at any stage, the device must continue and keep its counts. During a burst to the sensor,
// the device sends no reports.
TEST_CASE("long reports, aborted at every stage, do not block the device") {
  WildHost host(2000);
  std::mt19937& random = host.random();
  for (int i = 0; i < 300 / kShare; ++i) {
    const bool read = random() % 2 != 0;
    constexpr std::uint16_t kSizes[] = {4095, 4095, 4094, 1302, 1000, 64};
    const SetupPacket setup{static_cast<std::uint8_t>(read ? 0xa1 : 0x21),
                            static_cast<std::uint8_t>(read ? 1 : 9),
                            static_cast<std::uint16_t>(read ? 0x0307 : 0x0306), 0,
                            kSizes[random() % std::size(kSizes)]};
    const auto course = static_cast<Course>(random() % kCourses);
    INFO("wValue " << setup.value << " wLength " << setup.length << " course "
                   << static_cast<int>(course));
    host.Send(setup, course);
    host.Recover(setup.value);
    host.Pass(static_cast<int>(random() % 8000));
  }
  host.Check();
}

}  // namespace
}  // namespace torquer::emulator
