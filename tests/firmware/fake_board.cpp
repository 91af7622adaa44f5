#include "tests/firmware/fake_board.h"

#include <algorithm>

#include "firmware/board/board.h"
#include "firmware/board/usb_packets.h"

namespace torquer::firmware {
namespace {
FakeBoard the_board;
}

FakeBoard& board() { return the_board; }
FakeBoard& NewBoard() { return the_board = FakeBoard{}; }

}  // namespace torquer::firmware

namespace torquer {
namespace board {
namespace {
firmware::FakeBoard& Fake() { return firmware::board(); }
}  // namespace

std::uint32_t NowUs() { return Fake().now_us++; }
void DelayUs(std::uint16_t us) { Fake().now_us += us; }
bool TakeFrameStart(std::uint32_t* start_us) {
  if (!Fake().frame_start_us) return false;
  *start_us = *Fake().frame_start_us;
  Fake().frame_start_us.reset();
  return true;
}
void Idle() {}
bool BusSuspended() { return Fake().bus_suspended; }
void WakeHost() {
  ++Fake().host_wakes;
  Fake().bus_suspended = false;
}
void KickWatchdog() { ++Fake().watchdog_kicks; }
void Restart() { throw firmware::Restarted("restart"); }
void EnterBootloader() { throw firmware::Restarted("bootloader"); }
std::uint8_t ResetReason() { return Fake().reset_reason; }
std::uint8_t LoadWarmByte(bool* valid) {
  *valid = Fake().warm_byte.has_value();
  return Fake().warm_byte.value_or(0);
}
void StoreWarmByte(std::uint8_t value) { Fake().warm_byte = value; }
std::uint16_t StackHeadroom() { return 1234; }
std::uint8_t ClockCode() { return 16; }
std::uint8_t Board() { return 1; }
void ReadChipSerial(std::uint8_t serial[10]) {
  std::copy(Fake().chip_serial.begin(), Fake().chip_serial.end(), serial);
}
std::uint8_t ReadFlash(const std::uint8_t* address) { return *address; }
bool ApplicationIsWhole() { return Fake().application_is_whole; }

void SelectSensor(std::uint8_t /*sensor*/, bool selected) {
  Fake().selected = selected;
  Fake().first_byte = true;
}
std::uint8_t TransferSpi(std::uint8_t byte) {
  firmware::FakeBoard& fake = Fake();
  fake.spi_log.push_back({fake.now_us, byte, fake.first_byte});
  fake.now_us += 4;
  const std::uint8_t answer =
      fake.selected && fake.sensor ? fake.sensor(byte, fake.first_byte) : std::uint8_t{0xff};
  fake.first_byte = false;
  return answer;
}

std::uint8_t TransferSpiAfter(std::uint8_t byte, std::uint8_t gap_us) {
  Fake().now_us += gap_us;
  return TransferSpi(byte);
}
void ReadSpi(std::uint8_t* bytes, std::uint8_t count) {
  for (; count != 0; --count) *bytes++ = TransferSpi(0);
}

void BeginAdc(Analog input) { Fake().input = static_cast<std::size_t>(input); }
std::uint16_t FinishAdc() { return Fake().analog.at(Fake().input); }
std::uint8_t ReadButtons() { return Fake().buttons; }

bool EepromReady() {
  if (Fake().eeprom_busy_polls == 0) return true;
  --Fake().eeprom_busy_polls;
  return false;
}
std::uint8_t ReadEeprom(std::uint16_t address) { return Fake().eeprom.at(address); }
void WriteEeprom(std::uint16_t address, std::uint8_t value) {
  firmware::FakeBoard& fake = Fake();
  if (fake.writes_until_loss && *fake.writes_until_loss == fake.eeprom_writes) {
    std::uint8_t& cell = fake.eeprom.at(address);
    if (fake.tear == firmware::FakeBoard::Tear::kErasing) cell |= fake.tear_bits;
    if (fake.tear == firmware::FakeBoard::Tear::kProgramming) cell = value | fake.tear_bits;
    throw firmware::PowerLost();
  }
  ++fake.eeprom_writes;
  fake.eeprom.at(address) = value;
}

bool TakeUsbReset() {
  const bool reset = Fake().bus_reset;
  Fake().bus_reset = false;
  return reset;
}
bool ControlPending() {
  return Fake().bus_reset || !Fake().setups.empty() || !Fake().control_data.empty();
}
bool TakeSetup(std::uint8_t packet[8]) {
  if (Fake().setups.empty()) return false;
  std::copy(Fake().setups.front().begin(), Fake().setups.front().end(), packet);
  Fake().setups.pop_front();
  Fake().control_stalled = false;
  Fake().control_data.clear();
  return true;
}
bool CanSendControl() { return Fake().can_send_control; }
void SendControl(const std::uint8_t* data, std::uint8_t size, bool) {
  Fake().control_sent.emplace_back(data, data + size);
}
bool HasControlData() { return !Fake().control_data.empty(); }
std::uint8_t ControlDataSize() {
  Fake().control_byte = 0;
  return static_cast<std::uint8_t>(Fake().control_data.front().size());
}
std::uint8_t NextControlByte() { return Fake().control_data.front().at(Fake().control_byte++); }
bool ReleaseControlData() {
  Fake().control_data.pop_front();
  return true;
}
void StallControl() { Fake().control_stalled = true; }
void WatchControl(bool, bool) {}
void HoldControl() { ++Fake().control_holds; }
void SetAddress(std::uint8_t address) { Fake().address = address; }

bool ConfigureInput(bool enabled) {
  if (enabled && Fake().memory_refused) return false;
  Fake().input_enabled = enabled;
  Fake().input_halted = false;
  Fake().inputs.clear();
  return true;
}
void HaltInput(bool halted) { Fake().input_halted = halted; }
bool InputHalted() { return Fake().input_halted; }
std::uint8_t QueuedInputs() { return static_cast<std::uint8_t>(Fake().inputs.size()); }
void DiscardInputs() { Fake().inputs.clear(); }
bool QueueInput(const std::uint8_t* data, std::uint8_t size) {
  if (Fake().inputs.size() == 2) return false;
  Fake().inputs.emplace_back(data, data + size);
  return true;
}

}  // namespace board
}  // namespace torquer
