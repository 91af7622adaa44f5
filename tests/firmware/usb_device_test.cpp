#include "firmware/src/usb_device.h"

#include <algorithm>
#include <catch2/catch.hpp>
#include <cstring>

#include "firmware/src/usb_descriptors.h"
#include "tests/firmware/fake_board.h"

namespace torquer::firmware {
namespace {

using Bytes = std::vector<std::uint8_t>;

class Reports final : public ReportHandler {
 public:
  std::uint8_t GetInputReport(std::uint8_t id, std::uint8_t* report) override {
    report[0] = id;
    return id == 1 ? 32 : 0;
  }
  std::uint8_t GetFeatureReport(std::uint8_t id, std::uint8_t* report) override {
    if (id != 3) return 0;
    for (std::uint8_t i = 0; i < 16; ++i) report[i] = static_cast<std::uint8_t>(id + i);
    return 16;
  }
  bool SetFeatureReport(const std::uint8_t* report, std::uint8_t size) override {
    taken = Bytes(report, report + size);
    return accept;
  }
  Bytes taken;
  bool accept = true;
};

/// Handler of long reports: report 6 is written with at least 200 bytes, report 7 is read.
class LongReports final : public LongReportHandler {
 public:
  bool BeginWrite(std::uint8_t id, std::uint16_t size) override {
    if (id != 6 || size < 200) return false;
    taken.clear();
    return true;
  }
  bool HasRoom() const override { return room; }
  void Put(std::uint8_t byte) override { taken.push_back(byte); }
  Progress EndWrite() override { return write_progress; }
  bool BeginRead(std::uint8_t id) override { return id == 7; }
  Progress Read(const std::uint8_t** data, std::uint16_t* size) override {
    *data = picture.data();
    *size = static_cast<std::uint16_t>(picture.size());
    return read_progress;
  }
  void Abandon() override { ++abandoned; }

  Bytes taken, picture = Bytes(100, 9);
  bool room = true;
  Progress write_progress = Progress::kReady, read_progress = Progress::kReady;
  int abandoned = 0;
};

class Conversation {
 public:
  Conversation() { NewBoard(); }

  void Setup(int type, int request, int value, int index, int length) {
    board().control_sent.clear();
    board().setups.push_back(
        {static_cast<std::uint8_t>(type), static_cast<std::uint8_t>(request),
         static_cast<std::uint8_t>(value), static_cast<std::uint8_t>(value >> 8),
         static_cast<std::uint8_t>(index), static_cast<std::uint8_t>(index >> 8),
         static_cast<std::uint8_t>(length), static_cast<std::uint8_t>(length >> 8)});
    for (int i = 0; i < 10; ++i) device.Poll();
  }
  /// Runs a complete control read and returns its packets.
  std::vector<Bytes> Read(int type, int request, int value, int index, int length) {
    Setup(type, request, value, index, length);
    std::vector<Bytes> packets = board().control_sent;
    board().control_data.emplace_back();
    device.Poll();
    return packets;
  }
  bool Acknowledged() const {
    return !board().control_stalled && board().control_sent == std::vector<Bytes>{{}};
  }
  void Configure() {
    Setup(0x00, 9, 1, 0, 0);
    REQUIRE(Acknowledged());
  }

  Reports reports;
  LongReports long_reports;
  const char serial[16] = {'A', 'B', '1'};
  UsbDevice device{reports, long_reports, serial};
};

TEST_CASE("descriptors come in packets of 32, cut to what was asked for") {
  Conversation usb;
  CHECK(usb.Read(0x80, 6, 0x0100, 0, 18) ==
        std::vector<Bytes>{Bytes(std::begin(kDeviceDescriptor), std::end(kDeviceDescriptor))});
  CHECK(usb.Read(0x80, 6, 0x0100, 0, 8).at(0).size() == 8);
  const std::vector<Bytes> configuration = usb.Read(0x80, 6, 0x0200, 0, 255);
  REQUIRE(configuration.size() == 2);
  CHECK(configuration[0].size() == 32);
  CHECK(configuration[1].size() == 2);
  CHECK(configuration[0][2] == 34);
  CHECK(usb.Read(0x81, 6, 0x2200, 0, 255).size() == 3);
  CHECK(usb.Read(0x81, 6, 0x2100, 0, 255).at(0).size() == 9);
}

TEST_CASE(
    "a transfer that ends on a full packet, short of what was asked for, ends with an empty one") {
  Conversation usb;
  const std::vector<Bytes> longer = usb.Read(0xa1, 1, 0x0101, 0, 64);  // 32 bytes to send
  REQUIRE(longer.size() == 2);
  CHECK(longer[1].empty());
  CHECK(usb.Read(0xa1, 1, 0x0101, 0, 32).size() == 1);
}

TEST_CASE("strings are UTF-16 with their length") {
  Conversation usb;
  CHECK(usb.Read(0x80, 6, 0x0303, 0x409, 255) ==
        std::vector<Bytes>{{8, 3, 'A', 0, 'B', 0, '1', 0}});
  CHECK(usb.Read(0x80, 6, 0x0301, 0x409, 255).at(0) ==
        Bytes{16, 3, 'T', 0, 'o', 0, 'r', 0, 'q', 0, 'u', 0, 'e', 0, 'r', 0});
  CHECK(usb.Read(0x80, 6, 0x0300, 0, 255) == std::vector<Bytes>{{4, 3, 9, 4}});
}

TEST_CASE("an address holds from the end of the request on") {
  Conversation usb;
  board().can_send_control = false;  // the host has not fetched the status yet
  usb.Setup(0x00, 5, 17, 0, 0);
  CHECK(board().address == 0);
  board().can_send_control = true;
  usb.device.Poll();
  CHECK(board().address == 17);
}

TEST_CASE("configuring enables the input endpoint, a bus reset ends it") {
  Conversation usb;
  CHECK_FALSE(usb.device.configured());
  usb.Configure();
  CHECK(usb.device.configured());
  CHECK(board().input_enabled);
  CHECK(usb.Read(0x80, 8, 0, 0, 1) == std::vector<Bytes>{{1}});
  board().bus_reset = true;
  usb.device.Poll();
  CHECK_FALSE(usb.device.configured());
  usb.Configure();
  usb.Setup(0x00, 9, 0, 0, 0);
  CHECK_FALSE(usb.device.configured());
  CHECK_FALSE(board().input_enabled);
}

TEST_CASE("the input endpoint is halted, reported so, and freed") {
  Conversation usb;
  usb.Configure();
  usb.Setup(0x02, 3, 0, 0x81, 0);
  CHECK(usb.Acknowledged());
  CHECK(usb.Read(0x82, 0, 0, 0x81, 2) == std::vector<Bytes>{{1, 0}});
  usb.Setup(0x02, 1, 0, 0x81, 0);
  CHECK(usb.Acknowledged());
  CHECK(usb.Read(0x82, 0, 0, 0x81, 2) == std::vector<Bytes>{{0, 0}});
}

TEST_CASE("the host's leave to wake it is kept, reported, and ends with a bus reset") {
  Conversation usb;
  usb.Configure();
  CHECK(usb.Read(0x80, 0, 0, 0, 2) == std::vector<Bytes>{{0, 0}});
  usb.Setup(0x00, 3, 1, 0, 0);
  CHECK(usb.Acknowledged());
  CHECK(usb.device.may_wake_host());
  CHECK(usb.Read(0x80, 0, 0, 0, 2) == std::vector<Bytes>{{2, 0}});
  usb.Setup(0x00, 1, 1, 0, 0);
  CHECK_FALSE(usb.device.may_wake_host());
  usb.Setup(0x00, 3, 1, 0, 0);
  board().bus_reset = true;
  usb.device.Poll();
  CHECK_FALSE(usb.device.may_wake_host());
}

TEST_CASE("a request that is refused changes nothing") {
  Conversation usb;
  usb.Configure();
  usb.Setup(0x00, 9, 0, 0, 1);
  CHECK(usb.device.configured());
  usb.Setup(0x02, 3, 0, 0x81, 1);
  CHECK_FALSE(board().input_halted);
  usb.Setup(0x00, 3, 1, 0, 1);
  CHECK_FALSE(usb.device.may_wake_host());
}

TEST_CASE("requests without sense are stalled") {
  Conversation usb;
  usb.Configure();
  struct Request {
    int type, request, value, index, length;
  };
  const Request requests[] = {
      {0x80, 6, 0x0600, 0, 10},                         // device qualifier of a full-speed device
      {0x80, 6, 0x0201, 0, 9},                          // second configuration
      {0x80, 6, 0x0304, 0x409, 9},                      // string without a text
      {0x00, 9, 2, 0, 0},                               // unknown configuration
      {0x00, 5, 128, 0, 0},                             // address out of range
      {0x00, 3, 2, 0, 0},                               // test mode of a full-speed device
      {0x00, 3, 1, 1, 0},                               // remote wake-up of another device
      {0x00, 3, 1, 0, 1},                               // remote wake-up with data
      {0x00, 9, 0, 0, 1},                               // configuration with data
      {0x00, 5, 9, 0, 1},                               // address with data
      {0x02, 3, 0, 0x81, 1},                            // halt with data
      {0x21, 10, 0x0700, 0, 1},                         // idle rate with data
      {0x02, 3, 0, 0x82, 0},                            // unknown endpoint
      {0x02, 3, 1, 0x81, 0},                            // unknown feature
      {0x01, 11, 1, 0, 0},                              // alternate interface
      {0xa1, 1, 0x0304, 0, 64},                         // feature report that cannot be read
      {0xa1, 1, 0x0203, 0, 64},                         // output report
      {0xa1, 1, 0x0303, 1, 64},                         // other interface
      {0x21, 9, 0x0303, 0, 0},                          // report without bytes
      {0x21, 9, 0x0303, 0, 4096},                       // report longer than any valid one
      {0x21, 9, 0x0203, 0, 16},                         // output report
      {0x21, 11, 0, 0, 0},                              // boot protocol
      {0xc0, 1, 0, 0, 1},                               // vendor request
      {0x40, 1, 0, 0, 0},          {0x80, 5, 0, 0, 0},  // SET_ADDRESS in the wrong direction
  };
  for (const Request& request : requests) {
    INFO("bmRequestType " << request.type << " bRequest " << request.request << " wValue "
                          << request.value);
    usb.Setup(request.type, request.request, request.value, request.index, request.length);
    CHECK(board().control_stalled);
    CHECK(board().control_sent.empty());
    // The next request is served.
    CHECK(usb.Read(0x80, 8, 0, 0, 1) == std::vector<Bytes>{{1}});
  }
}

TEST_CASE("a feature report is read and written") {
  Conversation usb;
  usb.Configure();
  CHECK(usb.Read(0xa1, 1, 0x0303, 0, 64).at(0).size() == 16);
  usb.Setup(0x21, 9, 0x0303, 0, 16);
  const Bytes report{3, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12, 13, 14, 15};
  board().control_data.push_back(report);
  usb.device.Poll();
  CHECK(usb.Acknowledged());
  CHECK(usb.reports.taken == report);
}

TEST_CASE("a report that a host has padded is taken, whatever the padding") {
  for (const int length : {17, 32, 33, 64, 100, 4095}) {
    CAPTURE(length);
    Conversation usb;
    usb.Configure();
    usb.Setup(0x21, 9, 0x0303, 0, length);
    Bytes padded{3, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12, 13, 14, 15};
    const Bytes report = padded;
    padded.resize(static_cast<std::size_t>(length), 0xee);
    for (std::size_t sent = 0; sent < padded.size(); sent += 32) {
      const auto end = std::min(padded.size(), sent + 32);
      board().control_data.emplace_back(padded.begin() + static_cast<std::ptrdiff_t>(sent),
                                        padded.begin() + static_cast<std::ptrdiff_t>(end));
      usb.device.Poll();
    }
    CHECK(usb.Acknowledged());
    REQUIRE(usb.reports.taken.size() >= report.size());
    CHECK(Bytes(usb.reports.taken.begin(), usb.reports.taken.begin() + 16) == report);
    CHECK(usb.reports.taken.size() <= ReportHandler::kCapacity);
  }
}

TEST_CASE("a long report is handed on byte by byte, as there is room for it") {
  Conversation usb;
  usb.Configure();
  usb.Setup(0x21, 9, 0x0306, 0, 200);
  Bytes sent;
  usb.long_reports.write_progress = LongReportHandler::Progress::kWait;
  for (int packet = 0; packet < 7; ++packet) {
    const Bytes bytes(packet < 6 ? 32 : 8, static_cast<std::uint8_t>(packet));
    board().control_data.push_back(bytes);
    usb.long_reports.room = false;
    usb.device.Poll();
    CHECK(usb.long_reports.taken.size() == sent.size());  // the host waits
    usb.long_reports.room = true;
    usb.device.Poll();
    sent.insert(sent.end(), bytes.begin(), bytes.end());
  }
  CHECK(usb.long_reports.taken == sent);
  CHECK(board().control_sent.empty());  // the sensor is busy with it
  CHECK(usb.long_reports.abandoned == 0);

  SECTION("and acknowledged when all is done") {
    usb.long_reports.write_progress = LongReportHandler::Progress::kReady;
    usb.device.Poll();
    CHECK(usb.Acknowledged());
  }
  SECTION("or stalled") {
    usb.long_reports.write_progress = LongReportHandler::Progress::kRefused;
    usb.device.Poll();
    CHECK(board().control_stalled);
  }
  SECTION("or given up by the host") {
    CHECK(usb.Read(0x80, 8, 0, 0, 1) == std::vector<Bytes>{{1}});
    CHECK(usb.long_reports.abandoned == 1);
  }
  CHECK(usb.Read(0x80, 8, 0, 0, 1) == std::vector<Bytes>{{1}});
}

TEST_CASE("a long report that is cut short, refused, or interrupted by a reset ends") {
  Conversation usb;
  usb.Configure();
  SECTION("cut short") {
    usb.Setup(0x21, 9, 0x0306, 0, 200);
    board().control_data.emplace_back(20, 1);
    usb.device.Poll();
    CHECK(board().control_stalled);
    CHECK(usb.long_reports.abandoned == 1);
  }
  SECTION("a bus reset in its midst") {
    usb.Setup(0x21, 9, 0x0306, 0, 200);
    board().bus_reset = true;
    usb.device.Poll();
    CHECK(usb.long_reports.abandoned == 1);
    usb.Configure();
  }
  SECTION("not to be taken now: it is read to its end and stalled") {
    usb.Setup(0x21, 9, 0x0306, 0, 64);
    board().control_data.emplace_back(32, 6);
    board().control_data.emplace_back(32, 6);
    usb.reports.accept = false;
    usb.device.Poll();
    usb.device.Poll();
    CHECK(board().control_stalled);
  }
  CHECK(usb.Read(0x80, 8, 0, 0, 1) == std::vector<Bytes>{{1}});
}

TEST_CASE("a long report is read once it is there") {
  Conversation usb;
  usb.Configure();
  usb.long_reports.read_progress = LongReportHandler::Progress::kWait;
  usb.Setup(0xa1, 1, 0x0307, 0, 200);
  CHECK(board().control_sent.empty());
  CHECK_FALSE(board().control_stalled);
  SECTION("and sent") {
    usb.long_reports.read_progress = LongReportHandler::Progress::kReady;
    for (int i = 0; i < 10; ++i) usb.device.Poll();
    Bytes all;
    for (const Bytes& packet : board().control_sent) {
      all.insert(all.end(), packet.begin(), packet.end());
    }
    CHECK(all == usb.long_reports.picture);
    CHECK(board().control_sent.size() == 4);
  }
  SECTION("or refused") {
    usb.long_reports.read_progress = LongReportHandler::Progress::kRefused;
    usb.device.Poll();
    CHECK(board().control_stalled);
  }
  SECTION("or given up by the host") {
    usb.Setup(0x80, 8, 0, 0, 1);
    CHECK(usb.long_reports.abandoned == 1);
  }
}

TEST_CASE("without memory for the input endpoint the device is not configured") {
  Conversation usb;
  board().memory_refused = true;
  usb.Setup(0x00, 9, 1, 0, 0);
  CHECK(board().control_stalled);
  CHECK_FALSE(usb.device.configured());
  board().memory_refused = false;
  usb.Configure();
}

TEST_CASE("a written report is stalled when refused, short, or of another id") {
  Conversation usb;
  usb.Configure();
  usb.reports.accept = false;
  usb.Setup(0x21, 9, 0x0303, 0, 4);
  board().control_data.push_back({3, 1, 2, 3});
  usb.device.Poll();
  CHECK(board().control_stalled);

  usb.reports.accept = true;
  usb.reports.taken.clear();
  usb.Setup(0x21, 9, 0x0303, 0, 16);
  board().control_data.push_back({3, 1, 2, 3});
  usb.device.Poll();
  CHECK(board().control_stalled);

  usb.Setup(0x21, 9, 0x0303, 0, 4);
  board().control_data.push_back({5, 1, 2, 3});
  usb.device.Poll();
  CHECK(board().control_stalled);
  CHECK(usb.reports.taken.empty());
}

TEST_CASE("a new request ends the one under way, in every stage") {
  Conversation usb;
  usb.Configure();
  board().can_send_control = false;
  usb.Setup(0x80, 6, 0x0200, 0, 255);  // data to the host, not fetched
  board().can_send_control = true;
  CHECK(usb.Read(0x80, 8, 0, 0, 1) == std::vector<Bytes>{{1}});
  usb.Setup(0x21, 9, 0x0303, 0, 16);  // data from the host, never sent
  CHECK(usb.Read(0x80, 8, 0, 0, 1) == std::vector<Bytes>{{1}});
  usb.Setup(0x80, 6, 0x0200, 0, 255);  // status of a read, never sent
  CHECK(usb.Read(0x80, 8, 0, 0, 1) == std::vector<Bytes>{{1}});
}

TEST_CASE("a host that ends a read early is let go") {
  Conversation usb;
  board().can_send_control = false;
  usb.Setup(0x80, 6, 0x0200, 0, 255);
  board().control_data.emplace_back();
  usb.device.Poll();
  board().can_send_control = true;
  for (int i = 0; i < 5; ++i) usb.device.Poll();
  CHECK(board().control_sent.empty());
}

protocol::InputReport Numbered(int sequence) {
  protocol::InputReport report{};
  report.sequence = static_cast<std::uint16_t>(sequence);
  return report;
}

int TakeInput() {
  if (board().inputs.empty()) return -1;
  protocol::InputReport report;
  std::memcpy(&report, board().inputs.front().data(), sizeof(report));
  board().inputs.pop_front();
  return report.sequence;
}

TEST_CASE("a host that polls gets every report") {
  Conversation usb;
  usb.Configure();
  for (int i = 0; i < 100; ++i) {
    usb.device.SendInput(Numbered(i));
    REQUIRE(TakeInput() == i);
  }
  CHECK(usb.device.frames_missed() == 0);
}

TEST_CASE("a host that skips a poll loses nothing, and one that lags a frame goes on so") {
  Conversation usb;
  usb.Configure();
  usb.device.SendInput(Numbered(0));
  for (int i = 1; i < 100; ++i) {
    usb.device.SendInput(Numbered(i));
    REQUIRE(TakeInput() == i - 1);
  }
  CHECK(usb.device.frames_missed() == 0);
}

TEST_CASE("after a pause a host reads the newest report first, and then all reports") {
  Conversation usb;
  usb.Configure();
  int sequence = 0;
  for (; sequence < 500; ++sequence) usb.device.SendInput(Numbered(sequence));
  CHECK(TakeInput() == sequence - 1);
  for (int i = 0; i < 50; ++i) {
    usb.device.SendInput(Numbered(sequence));
    REQUIRE(TakeInput() == sequence++);
  }
  CHECK(usb.device.frames_missed() == 3);
}

}  // namespace
}  // namespace torquer::firmware
