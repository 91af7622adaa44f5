// A host's conversation with the USB device of the firmware.
#pragma once

#include <catch2/catch.hpp>
#include <cstdint>
#include <vector>

#include "firmware/src/usb_device.h"
#include "tests/firmware/fake_board.h"

namespace torquer::firmware {

using Bytes = std::vector<std::uint8_t>;

/// Handler of short reports: input report 1 is read, feature report 3 is read and written.
class Reports final : public ReportHandler {
 public:
  static constexpr char kSerial[16] = {'A', 'B', '1'};

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
  const char* serial() const override { return kSerial; }
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

/// A host that talks to the device on a new board.
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
  UsbDevice device{reports, long_reports};
};

}  // namespace torquer::firmware
