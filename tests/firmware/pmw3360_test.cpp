#include "firmware/src/pmw3360.h"

#include <algorithm>
#include <array>
#include <catch2/catch.hpp>
#include <cstdint>
#include <vector>

#include "tests/firmware/fake_board.h"

namespace torquer::firmware {
namespace {

/// Sensor registers behind the fake board's SPI; the test injects faults.
class FakeSensor {
 public:
  explicit FakeSensor(std::uint32_t start_us = 0) {
    NewBoard().now_us = start_us;
    Reset();
    board().sensor = [this](std::uint8_t sent, bool first) { return Exchange(sent, first); };
  }

  /// One frame per millisecond, as in the firmware.
  MotionSample Frame(Pmw3360* driver) {
    const std::uint32_t start_us = board().now_us;
    driver->BeginRead();
    const MotionSample sample = driver->Read();
    driver->Maintain();
    board().now_us = start_us + 1000;
    return sample;
  }
  /// State after power-up: default resolution, rest modes, no frames yet.
  void Reset() {
    std::fill(std::begin(registers_), std::end(registers_), std::uint8_t{0});
    registers_[0x00] = product_id;
    registers_[0x01] = 0x05;
    registers_[0x0e] = product_id == 0x47 ? 0x63 : 0;
    registers_[0x0f] = product_id == 0x47 ? 0 : 0x31;
    registers_[0x10] = 0x20;
    registers_[0x3f] = static_cast<std::uint8_t>(~product_id);
    Unobserve();
  }
  void Unobserve() {
    frame_seen_ = false;
    observed_us_ = board().now_us;
  }
  void StartUp(Pmw3360* driver, int cpi = 1200) {
    driver->Start(static_cast<std::uint16_t>(cpi));
    for (int i = 0; i < 200 && !driver->running(); ++i) Frame(driver);
    REQUIRE(driver->running());
  }

  std::array<std::uint8_t, 12> burst{0x80, 0, 5, 0, 0xfd, 0xff, 60, 9, 90, 10, 1, 2};
  bool silent = false;
  bool shorted = false;
  std::uint8_t product_id = 0x42;  ///< used from the next reset on
  bool frames = true;              ///< it takes frames: bits of Observation get set
  struct Write {
    std::uint8_t address, value;
    bool operator==(const Write&) const = default;
  };
  std::vector<Write> writes;
  std::uint8_t& reg(int address) { return registers_[address]; }

 private:
  std::uint8_t Exchange(std::uint8_t sent, bool first) {
    std::uint8_t answer = 0;
    if (first) {
      address_ = sent;
      index_ = 0;
    } else if (address_ & 0x80) {
      writes.push_back({static_cast<std::uint8_t>(address_ & 0x7f), sent});
      registers_[address_ & 0x7f] = sent;
      if (address_ == (0x3a | 0x80)) Reset();
      if (address_ == (0x24 | 0x80)) Unobserve();
    } else if (address_ == 0x50) {
      answer = index_ == 1 ? Observation() : burst.at(index_);
      ++index_;
    } else if (address_ == 0x24) {
      answer = Observation();
    } else {
      answer = registers_[address_];
    }
    return silent ? 0xff : shorted ? 0x00 : answer;
  }

  std::uint8_t Observation() {
    frame_seen_ = frame_seen_ || (frames && board().now_us - observed_us_ > 300);
    return static_cast<std::uint8_t>((registers_[0x2a] ? 0x40 : 0) | (frame_seen_ ? 0x3f : 0));
  }

  std::uint8_t registers_[128] = {};
  std::uint8_t address_ = 0;
  std::size_t index_ = 0;
  std::uint32_t observed_us_ = 0;
  bool frame_seen_ = false;
};

TEST_CASE("the start: reset, motion, identity, rest modes off, resolution, all of it read back") {
  FakeSensor sensor;
  Pmw3360 driver;
  sensor.StartUp(&driver, 1600);
  CHECK(sensor.writes == std::vector<FakeSensor::Write>{
                             {0x3a, 0x5a}, {0x10, 0x00}, {0x0f, 15}, {0x24, 0x00}, {0x50, 0x00}});
  std::vector<int> read;
  for (const FakeBoard::SpiByte& byte : board().spi_log) {
    if (byte.first && !(byte.sent & 0x80)) read.push_back(byte.sent);
  }
  // The last read is a burst: it discards counts at the sensor's default resolution.
  CHECK(read == std::vector<int>{0x02, 0x03, 0x04, 0x05, 0x06, 0x00, 0x01, 0x3f, 0x24, 0x10, 0x0f,
                                 0x00, 0x2a, 0x50});
  CHECK(driver.product_id() == 0x42);
  CHECK(driver.revision() == 0x05);
  CHECK(driver.srom_id() == 0);
  CHECK(driver.observation() == 0x3f);
  CHECK(driver.cpi() == 1600);
  CHECK(driver.restarts() == 0);
  CHECK(driver.fault_cause() == protocol::kSensorNoFault);
}

TEST_CASE("no access comes before the sensor's power-up and reset times") {
  FakeSensor sensor;
  Pmw3360 driver;
  sensor.StartUp(&driver);
  const auto& log = board().spi_log;
  CHECK(log[0].at_us >= 50000);
  CHECK(log[2].at_us - log[1].at_us >= 50000);
}

TEST_CASE("the times between bytes are those of the data sheet") {
  FakeSensor sensor;
  Pmw3360 driver;
  sensor.StartUp(&driver);
  for (int i = 0; i < 600; ++i) sensor.Frame(&driver);
  constexpr std::uint32_t kByteUs = 4;
  const auto& log = board().spi_log;
  int reads = 0, bursts = 0, writes = 0;
  std::uint32_t last_write_end = 0, last_read_end = 0;
  for (std::size_t i = 0; i + 1 < log.size(); ++i) {
    if (!log[i].first) continue;
    CHECK(log[i].at_us - last_write_end >= 180);
    CHECK(log[i].at_us - last_read_end >= 20);
    const std::uint32_t gap = log[i + 1].at_us - (log[i].at_us + kByteUs);
    if (log[i].sent & 0x80) {
      last_write_end = log[i + 1].at_us + kByteUs;
      ++writes;
    } else if (log[i].sent == 0x50) {
      CHECK(gap >= 35);
      ++bursts;
    } else {
      CHECK(gap >= 160);
      last_read_end = log[i + 1].at_us + kByteUs;
      ++reads;
    }
  }
  CHECK(bursts >= 600);
  CHECK(reads >= 24);
  CHECK(writes >= 24);
}

TEST_CASE("a burst becomes a sample") {
  FakeSensor sensor;
  Pmw3360 driver;
  sensor.StartUp(&driver);
  MotionSample sample = sensor.Frame(&driver);
  CHECK_FALSE(sample.fault);
  CHECK(sample.motion);
  CHECK_FALSE(sample.lifted);
  CHECK(sample.delta_x == 5);
  CHECK(sample.delta_y == -3);
  CHECK(sample.surface_quality == 60);
  CHECK(sample.shutter == 0x0102);
  sensor.burst = {0x08, 0, 0xff, 0x7f, 0x00, 0x80, 2, 1, 3, 1, 0, 9};
  sample = sensor.Frame(&driver);
  CHECK_FALSE(sample.motion);
  CHECK(sample.lifted);
  CHECK(sample.delta_x == 32767);
  CHECK(sample.delta_y == -32768);
}

TEST_CASE("until it runs the driver reports a fault and no motion") {
  FakeSensor sensor;
  Pmw3360 driver;
  driver.Start(1200);
  for (int i = 0; i < 50; ++i) {
    const MotionSample sample = sensor.Frame(&driver);
    CHECK(sample.fault);
    CHECK(sample.delta_x == 0);
  }
}

TEST_CASE("a silent or shorted sensor is a fault at once and is started again when it answers") {
  for (const bool high : {true, false}) {
    FakeSensor sensor;
    Pmw3360 driver;
    sensor.StartUp(&driver);
    (high ? sensor.silent : sensor.shorted) = true;
    for (int i = 0; i < 400; ++i) {
      const MotionSample sample = sensor.Frame(&driver);
      REQUIRE(sample.fault);
      REQUIRE(sample.delta_x == 0);
      REQUIRE(sample.delta_y == 0);
    }
    CHECK(driver.restarts() >= 2);
    CHECK(driver.product_id() == 0);
    sensor.silent = sensor.shorted = false;
    int frames = 0;
    while (sensor.Frame(&driver).fault) REQUIRE(++frames < 2000);
    CHECK(driver.product_id() == 0x42);
    CHECK(sensor.Frame(&driver).delta_x == 5);
  }
}

TEST_CASE("a single bad reading is not counted and does not restart the sensor") {
  FakeSensor sensor;
  Pmw3360 driver;
  sensor.StartUp(&driver);
  sensor.silent = true;
  CHECK(sensor.Frame(&driver).fault);
  sensor.silent = false;
  CHECK_FALSE(sensor.Frame(&driver).fault);
  CHECK(driver.restarts() == 0);
}

TEST_CASE("attempts to start become rarer, down to one in 1.6 s") {
  FakeSensor sensor;
  sensor.silent = true;
  Pmw3360 driver;
  driver.Start(1200);
  for (int i = 0; i < 30000; ++i) sensor.Frame(&driver);
  CHECK(driver.restarts() >= 18);
  CHECK(driver.restarts() <= 24);
}

TEST_CASE("a reset of the sensor is detected at any resolution, and its counts are withheld") {
  for (const int cpi : {1600, 5000}) {
    FakeSensor sensor;
    Pmw3360 driver;
    sensor.StartUp(&driver, cpi);
    for (int i = 0; i < 10; ++i) sensor.Frame(&driver);
    sensor.Reset();
    sensor.frames = false;  // not yet
    CHECK(sensor.Frame(&driver).fault);
    sensor.frames = true;
    int frames = 0;
    for (MotionSample sample = sensor.Frame(&driver); sample.fault;
         sample = sensor.Frame(&driver)) {
      REQUIRE(sample.delta_x == 0);
      REQUIRE(sample.delta_y == 0);
      REQUIRE(++frames < 200);
    }
    CHECK(sensor.reg(0x0f) == cpi / 100 - 1);
    CHECK(sensor.reg(0x10) == 0);
    CHECK(driver.restarts() == 1);
    CHECK(driver.self_resets() == 1);
    CHECK(driver.fault_cause() == protocol::kSensorReset);
  }
}

TEST_CASE("a reset between two readings is detected by the lost registers") {
  for (const int address : {0x0f, 0x10}) {
    FakeSensor sensor;
    Pmw3360 driver;
    sensor.StartUp(&driver, 1600);
    for (int i = 0; i < 10; ++i) sensor.Frame(&driver);
    sensor.reg(address) = address == 0x0f ? 0x31 : 0x20;
    int frames = 0;
    while (!sensor.Frame(&driver).fault) REQUIRE(++frames < 5 * 32 + 10);
    while (sensor.Frame(&driver).fault) REQUIRE(++frames < 1000);
    CHECK(sensor.reg(0x0f) == 15);
    CHECK(sensor.reg(0x10) == 0);
    CHECK(driver.self_resets() == 1);
  }
}

TEST_CASE("a PMW3389 is driven, with its own register of the resolution") {
  FakeSensor sensor;
  sensor.product_id = 0x47;
  Pmw3360 driver;
  sensor.StartUp(&driver, 3200);
  CHECK(driver.product_id() == 0x47);
  CHECK(sensor.reg(0x0e) == 63);  // 3200 counts an inch in steps of 50
  CHECK(sensor.reg(0x0f) == 0);
  driver.SetCpi(12000);
  for (int i = 0; i < 200; ++i) CHECK_FALSE(sensor.Frame(&driver).fault);
  CHECK(sensor.reg(0x0e) == 239);
  CHECK(driver.restarts() == 0);
  sensor.reg(0x0e) = 0x63;  // its value after a reset
  int faults = 0;
  for (int i = 0; i < 500; ++i) faults += sensor.Frame(&driver).fault ? 1 : 0;
  CHECK(faults > 0);
  CHECK(driver.self_resets() == 1);
  CHECK(sensor.reg(0x0e) == 239);
}

TEST_CASE("reserved bits of a register do not make a fault") {
  FakeSensor sensor;
  Pmw3360 driver;
  sensor.StartUp(&driver);
  sensor.reg(0x10) = 0xda;  // bits 7:6, 4:3 and 1 of Config2
  for (int i = 0; i < 200; ++i) CHECK_FALSE(sensor.Frame(&driver).fault);
  CHECK(driver.restarts() == 0);
}

TEST_CASE("a sensor that shows a rest mode has lost its configuration") {
  FakeSensor sensor;
  Pmw3360 driver;
  sensor.StartUp(&driver);
  for (int i = 0; i < 3; ++i) sensor.Frame(&driver);
  sensor.burst[0] |= 0x02;
  sensor.reg(0x10) = 0x20;
  CHECK(sensor.Frame(&driver).fault);
  CHECK(driver.self_resets() == 1);
}

TEST_CASE("a byte that was spoiled on its way costs no count") {
  FakeSensor sensor;
  Pmw3360 driver;
  sensor.StartUp(&driver);
  sensor.Frame(&driver);
  sensor.burst[0] |= 0x04;  // looks like a rest mode
  MotionSample sample = sensor.Frame(&driver);
  CHECK(sample.fault);
  CHECK(sample.delta_x == 0);
  sensor.burst[0] &= 0xf9;
  sample = sensor.Frame(&driver);
  CHECK_FALSE(sample.fault);
  CHECK(sample.delta_x == 10);
  CHECK(sample.delta_y == -6);
  CHECK(sensor.Frame(&driver).delta_x == 5);
  CHECK(driver.restarts() == 0);
}

TEST_CASE("a frozen sensor is detected by missing frame bits") {
  FakeSensor sensor;
  Pmw3360 driver;
  sensor.StartUp(&driver);
  // The earlier bits stay set, so bursts look valid until the driver clears them.
  for (int i = 0; i < 4; ++i) sensor.Frame(&driver);
  sensor.frames = false;
  int frames = 0;
  while (!sensor.Frame(&driver).fault) REQUIRE(++frames < 5 * 32 + 30);
  CHECK(driver.restarts() >= 1);
}

TEST_CASE("a sensor whose frames never show is tried three times and then believed") {
  FakeSensor sensor;
  sensor.frames = false;
  Pmw3360 driver;
  driver.Start(1200);
  int frames = 0;
  while (!driver.running()) {
    sensor.Frame(&driver);
    REQUIRE(++frames < 1000);
  }
  CHECK(driver.restarts() == 2);
  CHECK(driver.fault_cause() == protocol::kSensorFrozen);
  CHECK(driver.observation() == 0);
  for (int i = 0; i < 500; ++i) REQUIRE_FALSE(sensor.Frame(&driver).fault);
}

TEST_CASE("a start that the sensor does not keep is begun again, and not all at once") {
  FakeSensor sensor;
  Pmw3360 driver;
  driver.Start(1200);
  // The sensor does not keep its resolution.
  for (int i = 0; i < 5000; ++i) {
    sensor.Frame(&driver);
    sensor.reg(0x0f) = 0x31;
  }
  CHECK_FALSE(driver.running());
  CHECK(driver.restarts() >= 5);
  CHECK(driver.restarts() <= 10);
}

TEST_CASE("another sensor is refused, and its id is reported") {
  FakeSensor sensor;
  sensor.product_id = 0x33;
  Pmw3360 driver;
  driver.Start(1200);
  for (int i = 0; i < 150; ++i) CHECK(sensor.Frame(&driver).fault);
  CHECK(driver.product_id() == 0x33);
  CHECK_FALSE(driver.running());
}

TEST_CASE("a new resolution takes effect without a restart") {
  FakeSensor sensor;
  Pmw3360 driver;
  sensor.StartUp(&driver, 1200);
  driver.SetCpi(12000);
  for (int i = 0; i < 5; ++i) CHECK_FALSE(sensor.Frame(&driver).fault);
  CHECK(driver.cpi() == 12000);
  CHECK(sensor.reg(0x0f) == 119);
  CHECK(driver.restarts() == 0);
}

TEST_CASE("a wrap of the clock stops no state: start, running, or waiting") {
  for (const std::uint32_t before_wrap_us : {30000u, 80000u, 500000u, 3000000u}) {
    FakeSensor sensor(0u - before_wrap_us);
    Pmw3360 driver;
    sensor.StartUp(&driver);
    for (int i = 0; i < 4000; ++i) REQUIRE_FALSE(sensor.Frame(&driver).fault);
  }
  FakeSensor sensor(0u - 400000u);
  Pmw3360 driver;
  sensor.StartUp(&driver);
  sensor.silent = true;
  for (int i = 0; i < 1000; ++i) sensor.Frame(&driver);
  sensor.silent = false;
  int frames = 0;
  while (sensor.Frame(&driver).fault) REQUIRE(++frames < 2000);
}

TEST_CASE("the driver runs on after half a wrap of the clock") {
  FakeSensor sensor;
  Pmw3360 driver;
  sensor.StartUp(&driver);
  for (int i = 0; i < 50; ++i) {
    board().now_us += 60000000u;  // a minute between frames; only the time counts
    REQUIRE_FALSE(sensor.Frame(&driver).fault);
  }
  driver.SetCpi(2400);
  for (int i = 0; i < 3; ++i) sensor.Frame(&driver);
  CHECK(driver.cpi() == 2400);
}

}  // namespace
}  // namespace torquer::firmware
