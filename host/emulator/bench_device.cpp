#include "host/emulator/bench_device.h"

#include <cctype>
#include <cmath>
#include <cstring>
#include <iterator>
#include <utility>

#include "host/support/error.h"
#include "protocol/eeprom_layout.h"
#include "protocol/firmware_image.h"
#include "protocol/hid_reports.h"

namespace torquer::emulator {
namespace {

// The wiring: the table in firmware/README.md.
constexpr char kSensorSelectPort = 'B';
constexpr int kSensorSelectBit = 6;
constexpr int kSecondSelectBit = 5;
struct ButtonWire {
  protocol::Button button;
  char port;
  int bit;
};
constexpr ButtonWire kButtonWires[] = {{protocol::kButtonXray, 'D', 1},
                                       {protocol::kButtonContrast, 'D', 0},
                                       {protocol::kButtonClutch, 'D', 4},
                                       {protocol::kButtonStick, 'D', 7}};
constexpr char kReferencePort = 'C';
constexpr int kReferenceBit = 6;
constexpr int kJoystickXChannel = 7;
constexpr int kJoystickYChannel = 6;

// LEDs of a Pro Micro, Micro or Leonardo, with the level that lights each.
struct Led {
  const char* name;
  char port;
  int bit;
  bool on_level;
};
constexpr Led kLeds[] = {{"RX LED, 4 to 9 mA", 'B', 0, false},
                         {"TX LED, 4 to 9 mA", 'D', 5, false},
                         {"LED 13, 4 mA", 'C', 7, true}};

// Address in the signature row of the factory's data: lot, wafer and position on the wafer.
constexpr std::size_t kFactorySerial = 0x0e;

void PutSerial(const std::string& serial, std::vector<std::uint8_t>* eeprom) {
  protocol::SerialRecord record{};
  bool printable = !serial.empty() && serial.size() <= sizeof(record.serial);
  for (const char c : serial) printable = printable && std::isgraph(static_cast<unsigned char>(c));
  if (!printable) {
    throw UserError("--serial `" + serial +
                    "`: a serial number has 1 to 16 printable ASCII characters without spaces.");
  }
  std::memcpy(record.serial, serial.data(), serial.size());
  record.crc = protocol::Crc16(record.serial, sizeof(record.serial));
  std::memcpy(eeprom->data() + protocol::kEepromSerialAddress, &record, sizeof(record));
}

}  // namespace

BenchDevice::BenchDevice(const FirmwareImage& image, const BenchOptions& options)
    : image_(image),
      options_(options),
      sensor_(options.sensor, options.seed),
      eeprom_(options.eeprom),
      cpu_mhz_(image.cpu_hz() / 1e6) {
  if (!(options.cylinder_radius_mm > 0) || !std::isfinite(options.cylinder_radius_mm)) {
    throw UserError("--cylinder-radius-mm must be a positive number of millimeters.");
  }
  for (std::size_t i = 0; i <= std::size(kButtonWires); ++i) {
    contacts_.emplace_back(options.contact_bounce_us,
                           options.seed * 31 + static_cast<std::uint32_t>(i));
  }
  eeprom_.resize(Atmega32u4::kEepromBytes, 0xff);
  if (!options.serial.empty()) PutSerial(options.serial, &eeprom_);
  if (options.start_time_us) image_.SetInitialValue("torquer_clock_us", *options.start_time_us);
  if (image.board() == protocol::kBoardTwoSensorsAtmega32u4) {
    second_sensor_ = std::make_unique<VirtualPmw3360>(options.sensor, options.seed + 1);
  }
  for (VirtualPmw3360* sensor : {&sensor_, second_sensor_.get()}) {
    if (sensor == nullptr) continue;
    sensor->SetOptics(options.optics);
    sensor->SetKind(options.sensor_kind);
  }
  PowerOn();
}

void BenchDevice::PowerOn() {
  if (powered()) return;
  power_on_us_ = now_us_;
  chip_ = std::make_unique<Atmega32u4>(image_, eeprom_, options_.seed + power_ons_++,
                                       options_.supply_mv);
  std::array<std::uint8_t, FlashMemory::kSignatureRowBytes> row;
  row.fill(0xff);
  for (std::size_t i = kFactorySerial; i < kFactorySerial + 10; ++i) {
    row[i] = static_cast<std::uint8_t>(options_.seed * 37 + i);
  }
  chip_->flash().SetSignatureRow(row);
  chip_->flash().SetOperationTime(options_.page_operation_us);
  chip_->flash().on_operation = [this] {
    if (++page_operations_ == cut_at_page_operation_) cut_due_ = true;
  };

  WireSensor(sensor_, kSensorSelectBit, false);
  if (second_sensor_) WireSensor(*second_sensor_, kSecondSelectBit, true);
  chip_->SetSpiSlave([this](const SpiExchange& exchange) { return ExchangeSpi(exchange); });
  ApplyHand();
}

void BenchDevice::WireSensor(VirtualPmw3360& sensor, int select_bit, bool catheter) {
  sensor.PowerUp(0);
  sensor.SetSurface([this, catheter](double us) {
    const HandState hand = hand_((power_on_us_ + us) * 1e-6);
    const double insertion_mm = catheter ? hand.catheter_insertion_mm : hand.insertion_mm;
    const double rotation_rad = catheter ? hand.catheter_rotation_rad : hand.rotation_rad;
    return VirtualPmw3360::Position{insertion_mm, rotation_rad * options_.cylinder_radius_mm,
                                    hand.raises ? options_.play_mm : 0.0};
  });
  chip_->OnPin(kSensorSelectPort, select_bit,
               [&sensor](bool high, double us) { sensor.SetSelected(!high, us); });
}

// A sensor that is not selected leaves the line alone, which is pulled up.
std::uint8_t BenchDevice::ExchangeSpi(const SpiExchange& exchange) {
  const std::uint8_t answer = sensor_.Exchange(exchange);
  if (!second_sensor_) return answer;
  if (sensor_.selected() && second_sensor_->selected()) {
    past_violations_.emplace_back("SPI: both sensors are selected at once");
  }
  return answer & second_sensor_->Exchange(exchange);
}

void BenchDevice::PowerOff() {
  if (!powered()) return;
  eeprom_ = chip_->EepromAfterPowerLoss();
  image_.SetFlash(chip_->flash().AfterPowerLoss());
  past_cycles_ += chip_->cycles();
  past_sleep_cycles_ += chip_->sleep_cycles();
  for (std::string& violation : chip_->Violations()) past_violations_.push_back(violation);
  sensor_.SetSelected(false, chip_->now_us());
  if (second_sensor_) second_sensor_->SetSelected(false, chip_->now_us());
  chip_.reset();
}

void BenchDevice::ResetByPin() {
  if (powered()) chip_->ResetByPin();
}

void BenchDevice::RunUntil(double us) {
  // Pots and buttons follow the hand once a frame; the sensor asks for it by itself.
  while (now_us_ < us) {
    const double frame_end_us = (std::floor(now_us_ / kFrameUs) + 1) * kFrameUs;
    const double step_end_us = us < frame_end_us ? us : frame_end_us;
    if (powered()) {
      ApplyHand();
      chip_->RunUntil(step_end_us - power_on_us_);
      if (std::exchange(cut_due_, false)) PowerOff();
    }
    now_us_ = step_end_us;
  }
}

void BenchDevice::ApplyHand() {
  const HandState hand = HandNow();
  std::size_t contact = 0;
  for (const ButtonWire& wire : kButtonWires) {
    const bool held = (hand.buttons ^ options_.closed_at_rest) & wire.button;
    chip_->SetPin(wire.port, wire.bit, !contacts_[contact++].Conducts(held, now_us_));
  }
  const bool home =
      options_.reference_switch_mm && hand.insertion_mm <= *options_.reference_switch_mm;
  chip_->SetPin(kReferencePort, kReferenceBit, !contacts_[contact].Conducts(home, now_us_));
  chip_->SetAnalog(kJoystickXChannel, (hand.joystick_x + 1) / 2);
  chip_->SetAnalog(kJoystickYChannel, (hand.joystick_y + 1) / 2);
}

std::vector<std::uint8_t> BenchDevice::Flash() const {
  return powered() ? chip_->flash().Contents() : image_.flash();
}

std::vector<std::uint8_t> BenchDevice::Eeprom() const {
  return powered() ? chip_->eeprom() : eeprom_;
}

std::vector<std::string> BenchDevice::PartsAwake() const {
  std::vector<std::string> awake = chip_->PartsAwake();
  if (!sensor_.asleep()) awake.emplace_back("sensor");
  if (second_sensor_ && !second_sensor_->asleep()) awake.emplace_back("second sensor");
  for (const Led& led : kLeds) {
    if (chip_->DrivenLevel(led.port, led.bit) == led.on_level) awake.emplace_back(led.name);
  }
  return awake;
}

double BenchDevice::CyclesUsedFraction() const {
  const double cycles = static_cast<double>(past_cycles_ + (powered() ? chip_->cycles() : 0));
  const double asleep =
      static_cast<double>(past_sleep_cycles_ + (powered() ? chip_->sleep_cycles() : 0));
  return cycles > 0 ? 1 - asleep / cycles : 0;
}

std::vector<std::string> BenchDevice::Violations() const {
  std::vector<std::string> all = past_violations_;
  if (powered()) {
    const std::vector<std::string> current = chip_->Violations();
    all.insert(all.end(), current.begin(), current.end());
  }
  for (const VirtualPmw3360* sensor : {&sensor_, second_sensor()}) {
    if (sensor == nullptr) continue;
    all.insert(all.end(), sensor->violations().begin(), sensor->violations().end());
  }
  return all;
}

std::int64_t BenchDevice::violation_count() const {
  const std::size_t chip = past_violations_.size() + (powered() ? chip_->Violations().size() : 0);
  const std::int64_t second = second_sensor_ ? second_sensor_->violation_count() : 0;
  return static_cast<std::int64_t>(chip) + sensor_.violation_count() + second;
}

}  // namespace torquer::emulator
