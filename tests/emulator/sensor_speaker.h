// Driver stand-in that speaks to a virtual sensor with explicit times. All times are valid unless a
// test changes one.
#pragma once

#include <array>
#include <string>
#include <vector>

#include "host/emulator/pmw3360.h"

namespace torquer::emulator {

struct SensorSpeaker {
  explicit SensorSpeaker(const SensorImperfections& imperfections = {})
      : sensor(imperfections, 1) {}

  std::uint8_t Byte(int sent) {
    const double end_us = now_us + 8e6 / clock_hz;
    const std::uint8_t answer =
        sensor.Exchange({static_cast<std::uint8_t>(sent), now_us, end_us, clock_hz, mode});
    now_us = end_us;
    return answer;
  }
  void Select() {
    sensor.SetSelected(true, now_us);
    now_us += select_to_clock_us;
  }
  void Deselect(double after_us) {
    now_us += after_us;
    sensor.SetSelected(false, now_us);
  }
  int Read(int address) {
    Select();
    Byte(address);
    now_us += address_to_data_us;
    const int value = Byte(0);
    Deselect(1);
    now_us += after_read_us;
    return value;
  }
  void Write(int address, int value) {
    Select();
    Byte(address | 0x80);
    Byte(value);
    Deselect(write_to_deselect_us);
    now_us += after_write_us;
  }
  void Burst() {
    Select();
    Byte(0x50);
    now_us += address_to_burst_us;
    for (std::uint8_t& byte : burst) byte = Byte(0);
    Deselect(1);
    now_us += burst_exit_us;
  }
  void LoadSrom(const std::vector<std::uint8_t>& image) {
    Select();
    Byte(0x62 | 0x80);
    int sent = 0;
    for (const std::uint8_t byte : image) {
      now_us += sent++ == pause_after ? 200 : long_burst_us;
      Byte(byte);
    }
    Deselect(15);
    now_us += 200;
  }
  std::vector<std::uint8_t> RawData(int bytes) {
    std::vector<std::uint8_t> data;
    Select();
    Byte(0x64);
    now_us += address_to_data_us;
    for (int i = 0; i < bytes; ++i) {
      data.push_back(Byte(0));
      now_us += i == pause_after ? 200 : long_burst_us;
    }
    Deselect(1);
    now_us += after_read_us;
    return data;
  }
  /// First violation that the sensor detected; empty if none.
  std::string Violation() const {
    return sensor.violations().empty() ? "" : sensor.violations().front();
  }

  VirtualPmw3360 sensor;
  double now_us = 100000;
  double clock_hz = 2e6;
  int mode = 3;
  double select_to_clock_us = 0.2, address_to_data_us = 160, write_to_deselect_us = 35,
         after_read_us = 20, after_write_us = 145, address_to_burst_us = 35, burst_exit_us = 0.5,
         long_burst_us = 15;
  int pause_after = -1;  ///< byte of a long burst that a pause follows
  std::array<std::uint8_t, 12> burst{};
};

}  // namespace torquer::emulator
