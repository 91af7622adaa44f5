// Reports over the USB: short and long feature reports, and input reports.
#include <algorithm>
#include <catch2/catch.hpp>
#include <cstddef>
#include <cstring>

#include "tests/firmware/usb_conversation.h"

namespace torquer::firmware {
namespace {

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

TEST_CASE("a report with any padding is taken") {
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

TEST_CASE("a host that skips a poll loses no report, and one that lags a frame continues so") {
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
